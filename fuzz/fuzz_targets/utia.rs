#![no_main]

use libfuzzer_sys::fuzz_target;
use rosarium::io::utia;

fuzz_target!(|data: &[u8]| {
    let _ = utia::read(data);
});
