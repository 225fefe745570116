#![no_main]

use libfuzzer_sys::fuzz_target;
use rosarium::io::{csv_options::CsvOptions, readings_csv};

fuzz_target!(|data: &[u8]| {
    let _ = readings_csv::read(data, "fuzz.csv", &CsvOptions::default());
});
