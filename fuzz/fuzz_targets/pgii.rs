#![no_main]

use libfuzzer_sys::fuzz_target;
use rosarium::io::pgii;

fuzz_target!(|data: &[u8]| {
    let _ = pgii::read(data, "fuzz");
});
