//! Which instructions of processors the compiler offers.

fn main() {
    autocfg::new().emit_rustc_version(1, 89); // AVX-512
    autocfg::rerun_path("build.rs");
}
