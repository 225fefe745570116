//! The sections of the page: what each shows, and the command that makes each picture.
//!
//! A picture's command is run as it is shown, so the two cannot differ. Commands run in the page's folder; a command that
//! reads what another one writes names that file.

use clap::ValueEnum;
use rosarium::scene::petal::PRESETS;

use super::effort::Effort;

/// Names of the sections, in the thesis' order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Name {
    /// Cells and their Voronoi bases.
    Cells,
    /// Measured and simulated distribution, and fits to it.
    Distribution,
    /// The rose under the conventional shader and under the cell model.
    Bloom,
    /// Few and many sampling points.
    Points,
    /// Ray tracing, radiosity, transmission.
    Light,
    /// Petals of several cultivars.
    Cultivars,
    /// From bud to overblown.
    Growth,
}

impl Name {
    /// As the command line takes it.
    pub(super) fn word(self) -> String {
        self.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned())
    }
}

/// One section before its pictures are made.
pub(super) struct Section {
    pub(super) name: Name,
    pub(super) title: &'static str,
    pub(super) text: Vec<String>,
    pub(super) notice: Option<String>,
    pub(super) figures: Vec<Figure>,
    /// Pictures beside each other.
    pub(super) columns: usize,
}

/// One picture before it is made.
pub(super) struct Figure {
    /// File of the picture.
    pub(super) picture: String,
    pub(super) alt: String,
    pub(super) caption: String,
    /// Arguments of `rosarium`, separated by spaces.
    pub(super) command: String,
}

fn figure(picture: &str, alt: &str, caption: &str, command: &str) -> Figure {
    Figure {
        picture: picture.to_owned(),
        alt: alt.to_owned(),
        caption: caption.to_owned(),
        command: command.to_owned(),
    }
}

fn paragraphs(text: &[&str]) -> Vec<String> {
    text.iter().map(|p| (*p).to_owned()).collect()
}

/// Petal whose parameters the synthetic table comes from.
pub(super) const KNOWN_PETAL: &str = "thesis";
/// Said before the fits.
const SYNTHETIC: &str = "The table that is fitted here is synthetic. The thesis' readings were not published, so a virtual \
    goniophotometer measured the petal “thesis”, whose parameters are known. This shows that the fit finds them, not that real \
    petals have them.";
const ADD_YOURS: &str = " The flag --measurement FILE adds a fit to a table of your own.";

/// Angles of the lamp of the synthetic table, degrees.
const LAMPS: &str = "0,20,40,60,75";
/// Its wavelengths, nm, closer where the pigment's band ends: a fitted petal is linear between them.
const BANDS: &str = "450,500,550,575,600,625,650,700";
/// Reports of the fits to the synthetic table.
pub(super) const FITS: [&str; 2] = ["conventional.json", "cell_model.json"];
/// Report of the fits to the user's table.
pub(super) const MEASURED_FITS: &str = "measured.json";

/// The user's table as the commands name it.
pub(super) struct Table {
    pub(super) file: String,
    /// What the user called it.
    pub(super) name: String,
    pub(super) series: usize,
}

/// All sections, in order.
pub(super) fn sections(effort: &Effort, table: Option<&Table>) -> Vec<Section> {
    vec![
        cells(),
        distribution(effort, table),
        bloom(effort),
        points(effort),
        light(effort),
        cultivars(effort),
        growth(effort),
    ]
}

/// `--seed`, unless it is 0.
fn seed(effort: &Effort) -> String {
    if effort.seed == 0 { String::new() } else { format!(" --seed {}", effort.seed) }
}

/// Rest of a command that renders: size, samples, seed.
fn film(size: u32, spp: u32, effort: &Effort) -> String {
    format!("-D film.width={size} -D film.height={size} --spp {spp}{}", seed(effort))
}

fn cells() -> Section {
    let disorder = "-D cells.center_disorder=0.15 -D cells.height_disorder=0.15 -D cells.tilt_disorder_deg=5";
    Section {
        name: Name::Cells,
        title: "Cells",
        text: paragraphs(&[
            "The centres of the cells of the upper epidermis lie on a triangular grid 23 µm apart. The Voronoi division of the \
             plane gives each its base, a hexagon; on it stands a dome whose height is a cosine of the distance from the \
             centre, 37 µm at the top.",
            "In a living petal centres, heights and axes are not quite regular, and the bases are irregular polygons.",
        ]),
        notice: None,
        figures: vec![
            figure(
                "cells.png",
                "Map of regular domes with hexagonal outlines, and a section through a row of them",
                "The thesis' cells: height by colour, Voronoi bases in white, and a section along the orange line.",
                &format!("cells {KNOWN_PETAL} --plot cells.png"),
            ),
            figure(
                "cells_disorder.png",
                "Map of irregular domes with polygonal outlines, and a section through some of them",
                "The same with disorder of centres, heights and axes.",
                &format!("cells {KNOWN_PETAL} {disorder} --plot cells_disorder.png"),
            ),
        ],
        columns: 2,
    }
}

fn distribution(effort: &Effort, table: Option<&Table>) -> Section {
    let measure = format!(
        "measure {KNOWN_PETAL} --spin --incident {LAMPS} --wavelengths {BANDS} --rays {}{} \
         -o synthetic.csv --plot synthetic.svg",
        effort.rays,
        seed(effort)
    );
    let flat = format!(
        "measure {KNOWN_PETAL} -D cells.profile=flat --spin --incident {LAMPS} \
         --wavelengths {BANDS} --rays {}{} -o flat.csv --plot flat.svg",
        effort.rays,
        seed(effort)
    );
    let fit = |model: &str, name: &str| {
        format!(
            "fit synthetic.csv --model {model} --starts 2 --intervals 0{} --report {name}.json -o {name}.toml \
             --plot {name}.svg --residuals {name}_residuals.svg",
            seed(effort)
        )
    };
    let (conventional, cell_model) = (fit("lambert+phong", "conventional"), fit("terado", "cell_model"));
    let mut figures = vec![
        figure(
            "synthetic.svg",
            "Lobes of reflected light for five angles of the lamp; they lean to the lamp",
            "What the virtual goniophotometer measures on the petal of cells. Solid lines point to the lamp: light comes back to it.",
            &measure,
        ),
        figure(
            "flat.svg",
            "Lobes of reflected light for five angles of the lamp; they point to the mirror direction",
            "The same layers on flat cells: the highlight goes on to the mirror direction.",
            &flat,
        ),
        figure(
            "conventional.svg",
            "Measured points and the curves of the conventional model, which miss them",
            "Conventional shader (Lambert + Phong on a flat surface), fitted to the cells' table.",
            &conventional,
        ),
        figure(
            "cell_model.svg",
            "Measured points and the curves of the cell model, which go through them",
            "Cell model, fitted to the same table.",
            &cell_model,
        ),
        figure(
            "conventional_residuals.svg",
            "Residuals of the conventional model over the hemisphere: patches of one sign",
            "What the conventional shader gets wrong, by direction.",
            &conventional,
        ),
        figure(
            "cell_model_residuals.svg",
            "Residuals of the cell model over the hemisphere: noise",
            "What the cell model gets wrong, by direction.",
            &cell_model,
        ),
    ];
    let mut text = paragraphs(&[
        "The thesis measured how petals reflect, fitted its model to the readings by least squares, and found that petals send \
         light back towards the lamp, which Lambert and Phong on a flat surface cannot do.",
    ]);
    if let Some(table) = table {
        let pool = if table.series > 1 { " --pool" } else { "" };
        let command = format!(
            "fit {}{pool} --model lambert+phong,terado --starts 2 --intervals 0{} --report {MEASURED_FITS} \
             --plot measured.svg --residuals measured_residuals.svg",
            table.file,
            seed(effort)
        );
        text.push(format!(
            "The last two pictures and the last table are of your measurement {}{}; all others are of a synthetic table.",
            table.name,
            if table.series > 1 { ", all its series together" } else { "" }
        ));
        figures.push(figure(
            "measured.svg",
            "Readings of the measurement with the curves of both models",
            "The measurement, and both models fitted to it.",
            &command,
        ));
        figures.push(figure(
            "measured_residuals.svg",
            "Residuals of the better model over the hemisphere",
            "What the better of both models gets wrong.",
            &command,
        ));
    }
    Section {
        name: Name::Distribution,
        title: "Measured and simulated distribution",
        text,
        notice: Some(format!("{SYNTHETIC}{}", if table.is_some() { "" } else { ADD_YOURS })),
        figures,
        columns: 1,
    }
}

fn bloom(effort: &Effort) -> Section {
    let render = |petal: &str, name: &str| {
        format!(
            "render scenes/thesis.toml --petal {petal} -D petal.samples=8 --exposure -0.7 {} -o {name}.png -o {name}.exr",
            film(effort.size, effort.spp, effort)
        )
    };
    Section {
        name: Name::Bloom,
        title: "The bloom",
        text: paragraphs(&[
            "Camera straight in front of the rose, far light from the upper right front. The conventional shader puts its \
             highlights on petals that mirror the lamp. The cell model has none there; it has a whitish bloom where light or \
             view graze the petals, above all in the heart of the flower.",
            "The second picture is the conventional shader as it was fitted above: no highlight of a flat surface explains light that \
             comes back to the lamp, so the fit leaves none. It reflects about as much light as the cell model, so the last \
             picture shows where the cells send it.",
        ]),
        notice: None,
        figures: vec![
            figure(
                "bloom_flat.png",
                "A red rose with white highlights along folds of its petals",
                "Conventional shader with the cell model's coefficients.",
                &render("cell_model.toml -D petal.cells.profile=flat", "bloom_flat"),
            ),
            figure(
                "bloom_conventional.png",
                "A red rose without highlights, evenly dull",
                "Conventional shader, fitted.",
                &render("conventional.toml", "bloom_conventional"),
            ),
            figure(
                "bloom_cells.png",
                "A red rose with a whitish bloom in its heart and along rims",
                "Cell model, fitted.",
                &render("cell_model.toml", "bloom_cells"),
            ),
            figure(
                "bloom_difference.png",
                "Map of the difference: red in the heart of the rose and along rims, pale blue elsewhere",
                "Cell model less fitted conventional shader. Red: the cells send more light to the camera.",
                "compare bloom_cells.exr bloom_conventional.exr --plot signed --range 1 -o bloom_difference.png",
            ),
        ],
        columns: 2,
    }
}

fn points(effort: &Effort) -> Section {
    let one = |points: u32, caption: &str| {
        let name = format!("points_{points}.png");
        figure(
            &name,
            &format!("A red rose, each point shaded from {points} points of the cells"),
            caption,
            &format!(
                "render scenes/thesis.toml -D petal.samples={points} --exposure -0.7 {} -o {name}",
                film(effort.size, effort.few_spp, effort)
            ),
        )
    };
    Section {
        name: Name::Points,
        title: "Dull and shiny",
        text: paragraphs(&[
            "Each visible point is shaded from randomly chosen points of the cells. With few of them most points miss the \
             highlight and some have all of it: the petal looks dull and grainy. Many give each point its share: shiny and \
             smooth. The mean light is the same.",
        ]),
        notice: None,
        figures: vec![one(1, "One point: dull."), one(8, "8 points."), one(64, "64 points: shiny.")],
        columns: 3,
    }
}

fn light(effort: &Effort) -> Section {
    let one = |scene: &str, alt: &str, caption: &str| {
        let elements = match scene {
            "thesis" => String::new(),
            _ => format!(" -D render.radiosity.elements={}", effort.elements),
        };
        figure(
            &format!("light_{scene}.png"),
            alt,
            caption,
            &format!(
                "render scenes/{scene}.toml{elements} --denoise --exposure -0.3 {} -o light_{scene}.png",
                film(effort.size, effort.spp, effort)
            ),
        )
    };
    Section {
        name: Name::Light,
        title: "Light among petals",
        text: paragraphs(&[
            "Ray tracing alone finds the light that comes straight from the lamp; a petal in its way lets a weaker part straight \
             through. Radiosity adds the diffuse light that goes from petal to petal: in the second picture by reflection only, \
             from petals that let nothing through, so deep shadows stay nearly black; in the third also through the petals, \
             which fills the shadows with red.",
            "All three are denoised alike.",
        ]),
        notice: None,
        figures: vec![
            one("thesis", "A red rose with sharp dark red shadows", "Ray tracing alone."),
            one(
                "thesis_reflection",
                "A red rose with black shadows, a little lit from within",
                "With radiosity: reflection only.",
            ),
            one(
                "thesis_transmission",
                "A red rose whose shadows glow red",
                "With radiosity: reflection and transmission.",
            ),
        ],
        columns: 3,
    }
}

fn cultivars(effort: &Effort) -> Section {
    let tissue = PRESETS.iter().map(|p| p.0).filter(|name| *name != KNOWN_PETAL);
    Section {
        name: Name::Cultivars,
        title: "Cultivars",
        text: paragraphs(&[
            "The follow-up of the thesis adds cultivars. Here petals differ in their cells, layers and pigments, and light walks \
             through them: nothing is painted. The amounts of pigment have sources, scattering is our reading.",
        ]),
        notice: None,
        figures: tissue
            .map(|name| {
                let title = name.replace('_', " ");
                figure(
                    &format!("cultivar_{name}.png"),
                    &format!("A rose with petals of {title}"),
                    &title,
                    &format!(
                        "render --petal {name} -D petal.walks={} {} -o cultivar_{name}.png",
                        effort.walks,
                        film(effort.small, effort.spp, effort)
                    ),
                )
            })
            .collect(),
        columns: 6,
    }
}

/// How far the flower has opened, from bud to overblown.
const OPENNESS: [f64; 6] = [0.0, 0.25, 0.5, 0.75, 1.0, 1.3];

fn growth(effort: &Effort) -> Section {
    Section {
        name: Name::Growth,
        title: "Growth",
        text: paragraphs(&[
            "One flower from bud to overblown: the petals grow and bend out, and the domes of their cells rise with their age, so \
             the bloom changes, too.",
        ]),
        notice: None,
        figures: OPENNESS
            .iter()
            .map(|open| {
                let name = format!("growth_{:03.0}.png", 100.0 * open);
                figure(
                    &name,
                    &format!("The rose at openness {open}"),
                    &format!("Openness {open}"),
                    &format!(
                        "render -D shapes.rose.rose.openness={open:.2} -D petal.age={open:.2} {} -o {name}",
                        film(effort.small, effort.spp, effort)
                    ),
                )
            })
            .collect(),
        columns: 6,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::work;
    use super::*;

    fn all(seed: u64) -> Vec<Section> {
        let effort =
            Effort { size: 64, small: 32, spp: 4, few_spp: 1, rays: 1000, walks: 500, elements: 100, seed };
        let table = Table { file: "measurement.csv".to_owned(), name: "rose <1>.csv".to_owned(), series: 2 };
        sections(&effort, Some(&table))
    }

    #[test]
    fn every_section_has_pictures_and_every_picture_its_command() {
        let sections = all(3);
        let names: Vec<Name> = sections.iter().map(|s| s.name).collect();
        assert_eq!(names, Name::value_variants());
        let mut pictures = BTreeSet::new();
        for figure in sections.iter().flat_map(|s| &s.figures) {
            assert!(pictures.insert(figure.picture.clone()), "{} twice", figure.picture);
            assert!(work::written(&figure.command).contains(&figure.picture.as_str()), "{}", figure.command);
            assert!(!figure.alt.is_empty() && !figure.caption.is_empty(), "{}", figure.picture);
            work::parse(&figure.command).unwrap();
            // What is shown is what is run, letter by letter.
            assert_eq!(work::line(&figure.command), format!("rosarium {}", figure.command));
        }
        assert!(sections.iter().all(|s| !s.figures.is_empty() && !s.text.is_empty()));
    }

    #[test]
    fn no_two_commands_write_one_file() {
        let sections = all(0);
        let commands: BTreeSet<&str> =
            sections.iter().flat_map(|s| &s.figures).map(|f| f.command.as_str()).collect();
        let files: Vec<&str> = commands.iter().flat_map(|c| work::written(c)).collect();
        assert_eq!(files.iter().collect::<BTreeSet<_>>().len(), files.len(), "{files:?}");
        assert!(commands.iter().all(|c| !c.contains("--seed")), "0 is the default");
    }

    #[test]
    fn the_bloom_needs_the_fits() {
        let sections = all(0);
        let commands: Vec<&str> =
            sections.iter().flat_map(|s| &s.figures).map(|f| f.command.as_str()).collect();
        let difference = sections[2].figures.last().unwrap();
        let needed = work::with_needed(&difference.command, &commands);
        let starts: Vec<&str> = needed.iter().map(|c| c.split(' ').next().unwrap()).collect();
        assert_eq!(starts, ["measure", "fit", "fit", "render", "render", "compare"], "{needed:?}");
        assert!(needed.iter().all(|c| !c.contains("flat")), "{needed:?}");
    }
}
