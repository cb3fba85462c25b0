//! Nothing. The build scripts of iceoryx2 depend on bindgen everywhere and call it on QNX only;
//! without it the build compiles 11 crates fewer.
