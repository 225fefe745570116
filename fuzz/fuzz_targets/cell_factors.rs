#![no_main]

use libfuzzer_sys::fuzz_target;
use rosarium::gonio::CellFactors;

fuzz_target!(|data: &[u8]| {
    let _ = CellFactors::from_bytes(data, "fuzz");
});
