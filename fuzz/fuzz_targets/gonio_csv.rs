#![no_main]

use libfuzzer_sys::fuzz_target;
use rosarium::io::gonio_csv;

fuzz_target!(|data: &[u8]| {
    let _ = gonio_csv::read(data, "fuzz.csv");
});
