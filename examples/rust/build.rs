//! Where libcollide lies: `collide config --libs` tells, in the words of a linker.

use std::process::Command;

fn main() {
    println!("cargo:rerun-if-env-changed=PATH");
    let told = Command::new("collide").args(["config", "--libs"]).output().expect("pip install collide-robotics");
    assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
    for word in String::from_utf8_lossy(&told.stdout).split_whitespace() {
        if let Some(folder) = word.strip_prefix("-L") {
            println!("cargo:rustc-link-search=native={folder}");
        } else if let Some(library) = word.strip_prefix("-l") {
            println!("cargo:rustc-link-lib=dylib={library}");
        } else if word.starts_with("-Wl,-rpath,") {
            println!("cargo:rustc-link-arg={word}");
        }
    }
}
