#![no_main]

use libfuzzer_sys::fuzz_target;
use rosarium::io::rgl;

fuzz_target!(|data: &[u8]| {
    let _ = rgl::read(data);
});
