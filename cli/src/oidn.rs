//! Intel's Open Image Denoise, where the user has its library: loaded when it is asked for, never linked.
//!
//! The picture is filtered with albedo and normals as guides; these are filtered alone first, as the library's manual advises for
//! guides with noise of their own (from the lens and from sampled wavelengths), and then given as clean. It runs on the processor,
//! so that the result does not depend on a graphics card.

// Calls into a foreign library cannot be checked by the compiler. All of them are here, behind a safe function.
#![allow(unsafe_code)]

use std::ffi::{CStr, OsString, c_char, c_int, c_void};
use std::path::{Path, PathBuf};

use libloading::Library;
use rosarium::film::denoise::Noisy;
use rosarium::{Error, Result};

/// Says where the library is, as `--oidn` does.
pub(crate) const VARIABLE: &str = "OIDN_LIBRARY_PATH";

/// How to get it.
pub(crate) const HOW_TO_GET: &str = "`pip install pyoidn` brings it: give --oidn, or set OIDN_LIBRARY_PATH to, the folder \
     oidn/lib inside that package";

/// Names of the library: version 2, as development packages link it, and version 1 where it is still about.
#[cfg(target_os = "linux")]
const NAMES: &[&str] = &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so", "libOpenImageDenoise.so.1"];
#[cfg(target_os = "macos")]
const NAMES: &[&str] = &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"];
#[cfg(not(any(target_os = "linux", target_os = "macos")))]
const NAMES: &[&str] = &["OpenImageDenoise.dll"];

// From the library's public header.
const DEVICE_CPU: c_int = 1;
const FORMAT_FLOAT3: c_int = 3;

type NewDevice = unsafe extern "C" fn(c_int) -> *mut c_void;
type NewFilter = unsafe extern "C" fn(*mut c_void, *const c_char) -> *mut c_void;
type OnHandle = unsafe extern "C" fn(*mut c_void);
type SetBool = unsafe extern "C" fn(*mut c_void, *const c_char, bool);
type SetInt = unsafe extern "C" fn(*mut c_void, *const c_char, c_int);
type GetError = unsafe extern "C" fn(*mut c_void, *mut *const c_char) -> c_int;
type SetImage =
    unsafe extern "C" fn(*mut c_void, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);

/// The library, with the functions that are used.
pub(crate) struct Oidn {
    new_device: NewDevice,
    commit_device: OnHandle,
    release_device: OnHandle,
    set_device_int: SetInt,
    device_error: GetError,
    new_filter: NewFilter,
    set_image: SetImage,
    set_bool: SetBool,
    commit_filter: OnHandle,
    execute_filter: OnHandle,
    release_filter: OnHandle,
    /// Last: the functions live as long as it does.
    _library: Library,
}

impl Oidn {
    /// The library at `path` (a file, or the folder that holds it), of `--oidn`; of [`VARIABLE`]; or of the system, which may have
    /// none. A path that leads to no library is an error.
    pub(crate) fn find(path: Option<&Path>) -> Result<Option<Self>> {
        let variable = || std::env::var_os(VARIABLE).filter(|v: &OsString| !v.is_empty()).map(PathBuf::from);
        if let Some(path) = path {
            return Self::at("--oidn", path).map(Some);
        }
        if let Some(path) = variable() {
            return Self::at(VARIABLE, &path).map(Some);
        }
        Ok(NAMES.iter().find_map(|name| Self::open(name.as_ref()).ok()))
    }

    fn at(from: &str, path: &Path) -> Result<Self> {
        let fail = |what: String| Error::invalid(format!("{from} {}", path.display()), what);
        let file = match path.is_dir() {
            true => NAMES.iter().map(|name| path.join(name)).find(|p| p.exists()).ok_or_else(|| {
                fail(format!("this folder does not hold Open Image Denoise ({})", NAMES.join(", ")))
            })?,
            false => path.to_owned(),
        };
        Self::open(&file).map_err(|e| fail(format!("is not Open Image Denoise: {e}")))
    }

    fn open(path: &Path) -> std::result::Result<Self, libloading::Error> {
        // SAFETY: loading runs the initialisers of a library that the user has chosen. The functions have the types of its
        // published C interface, and are kept with it.
        unsafe {
            let library = Library::new(path)?;
            Ok(Self {
                new_device: *library.get(b"oidnNewDevice\0")?,
                commit_device: *library.get(b"oidnCommitDevice\0")?,
                release_device: *library.get(b"oidnReleaseDevice\0")?,
                set_device_int: *library
                    .get(b"oidnSetDeviceInt\0")
                    .or_else(|_| library.get(b"oidnSetDevice1i\0"))?,
                device_error: *library.get(b"oidnGetDeviceError\0")?,
                new_filter: *library.get(b"oidnNewFilter\0")?,
                set_image: *library.get(b"oidnSetSharedFilterImage\0")?,
                set_bool: *library
                    .get(b"oidnSetFilterBool\0")
                    .or_else(|_| library.get(b"oidnSetFilter1b\0"))?,
                commit_filter: *library.get(b"oidnCommitFilter\0")?,
                execute_filter: *library.get(b"oidnExecuteFilter\0")?,
                release_filter: *library.get(b"oidnReleaseFilter\0")?,
                _library: library,
            })
        }
    }

    /// The light without noise, linear sRGB.
    pub(crate) fn denoise(&self, noisy: &Noisy) -> Result<Vec<[f32; 3]>> {
        let size = noisy.size();
        let device = Device::new(self, rayon::current_num_threads())?;
        let albedo = device.filter(size, &[(c"albedo", noisy.albedo())], &[])?;
        let normal = device.filter(size, &[(c"normal", noisy.normal())], &[])?;
        let images = [(c"color", noisy.light()), (c"albedo", &albedo[..]), (c"normal", &normal[..])];
        let mut light = device.filter(size, &images, &[c"hdr", c"cleanAux"])?;
        for v in light.iter_mut().flatten() {
            // The library keeps to what is finite; its output may be a little below black.
            *v = v.max(0.0);
        }
        Ok(light)
    }
}

/// A device of the library, released when it is dropped.
struct Device<'a> {
    oidn: &'a Oidn,
    handle: *mut c_void,
}

impl<'a> Device<'a> {
    fn new(oidn: &'a Oidn, threads: usize) -> Result<Self> {
        // SAFETY: the interface's own order of calls; the handle is checked before use.
        let handle = unsafe { (oidn.new_device)(DEVICE_CPU) };
        let device = Self { oidn, handle };
        if handle.is_null() {
            return Err(device.error());
        }
        // SAFETY: the handle is a device.
        unsafe {
            (oidn.set_device_int)(handle, c"numThreads".as_ptr(), c_int::try_from(threads).unwrap_or(0));
            (oidn.commit_device)(handle);
        }
        device.check()?;
        Ok(device)
    }

    /// Runs one filter over named pictures of equal size.
    fn filter(
        &self,
        (width, height): (usize, usize),
        images: &[(&CStr, &[[f32; 3]])],
        flags: &[&CStr],
    ) -> Result<Vec<[f32; 3]>> {
        let mut output = vec![[0.0f32; 3]; width * height];
        if let Some((name, image)) = images.iter().find(|(_, image)| image.len() != output.len()) {
            let what = format!("{name:?} has {} pixels for {width} x {height}", image.len());
            return Err(Error::invalid("denoiser", what));
        }
        let oidn = self.oidn;
        // SAFETY: every picture has width x height pixels of three packed floats and outlives the filter, which reads the inputs
        // and writes the output alone.
        unsafe {
            let filter = (oidn.new_filter)(self.handle, c"RT".as_ptr());
            if filter.is_null() {
                return Err(self.error());
            }
            let set = |name: &CStr, pixels: *mut c_void| {
                (oidn.set_image)(filter, name.as_ptr(), pixels, FORMAT_FLOAT3, width, height, 0, 0, 0);
            };
            for (name, image) in images {
                set(name, image.as_ptr().cast_mut().cast());
            }
            set(c"output", output.as_mut_ptr().cast());
            for flag in flags {
                (oidn.set_bool)(filter, flag.as_ptr(), true);
            }
            (oidn.commit_filter)(filter);
            (oidn.execute_filter)(filter);
            (oidn.release_filter)(filter);
        }
        self.check()?;
        Ok(output)
    }

    fn message(&self) -> Option<String> {
        let mut text = std::ptr::null();
        // SAFETY: a null device asks for this thread's last error; the text lives until the next call on the device.
        unsafe {
            let code = (self.oidn.device_error)(self.handle, &mut text);
            (code != 0).then(|| match text.is_null() {
                true => format!("error {code}"),
                false => CStr::from_ptr(text).to_string_lossy().into_owned(),
            })
        }
    }

    fn error(&self) -> Error {
        Error::invalid("Open Image Denoise", self.message().unwrap_or_else(|| "it does not start".to_owned()))
    }

    fn check(&self) -> Result<()> {
        match self.message() {
            Some(what) => Err(Error::invalid("Open Image Denoise", what)),
            None => Ok(()),
        }
    }
}

impl Drop for Device<'_> {
    fn drop(&mut self) {
        if !self.handle.is_null() {
            // SAFETY: made by this library and released once.
            unsafe { (self.oidn.release_device)(self.handle) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_library_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let text = |path: &Path| Oidn::find(Some(path)).err().expect("no library").to_string();
        assert!(text(folder.path()).contains("does not hold Open Image Denoise"));
        assert!(text(&folder.path().join("none.so")).contains("none.so"));
        let file = folder.path().join("wrong.so");
        std::fs::write(&file, "no library").expect("written");
        assert!(text(&file).contains("is not Open Image Denoise"));
    }
}
