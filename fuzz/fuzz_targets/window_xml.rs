#![no_main]

use libfuzzer_sys::fuzz_target;
use rosarium::io::window_xml;

fuzz_target!(|data: &[u8]| {
    let _ = window_xml::read(data, "fuzz");
});
