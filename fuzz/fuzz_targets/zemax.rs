#![no_main]

use libfuzzer_sys::fuzz_target;
use rosarium::io::zemax;

fuzz_target!(|data: &[u8]| {
    let _ = zemax::read(data, "fuzz");
});
