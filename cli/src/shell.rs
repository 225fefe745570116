//! Command lines as a shell reads them.

/// The command that this process was started with.
pub(crate) fn command() -> String {
    line(std::env::args().skip(1))
}

/// `rosarium` with arguments, quoted where a shell would change them.
pub(crate) fn line(arguments: impl IntoIterator<Item = String>) -> String {
    std::iter::once("rosarium".to_owned())
        .chain(arguments.into_iter().map(quoted))
        .collect::<Vec<_>>()
        .join(" ")
}

/// An argument for a POSIX shell.
fn quoted(argument: String) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:+%@".contains(c);
    if !argument.is_empty() && argument.chars().all(plain) {
        return argument;
    }
    format!("'{}'", argument.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_shell_would_change_is_quoted() {
        let line = |arguments: &[&str]| line(arguments.iter().map(|a| (*a).to_owned()));
        assert_eq!(
            line(&["fit", "a.csv", "--bounds", "n_E=2..100"]),
            "rosarium fit a.csv --bounds n_E=2..100"
        );
        for (argument, text) in [
            ("a b", "'a b'"),
            ("", "''"),
            ("it's", r"'it'\''s'"),
            ("ks=0.5*kd", "'ks=0.5*kd'"),
            ("$(x);", "'$(x);'"),
        ] {
            assert_eq!(line(&[argument]), format!("rosarium {text}"));
        }
    }
}
