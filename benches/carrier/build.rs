//! The C loop with the usual flags for speed.

fn main() {
    println!("cargo:rerun-if-changed=carrier.c");
    cc::Build::new().file("carrier.c").opt_level(3).flag("-std=c11").warnings(true).compile("carrier");
}
