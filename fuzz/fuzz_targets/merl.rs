#![no_main]

use libfuzzer_sys::fuzz_target;
use rosarium::io::merl;

fuzz_target!(|data: &[u8]| {
    let _ = merl::read(data);
});
