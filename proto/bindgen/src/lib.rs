//! Empty. The build scripts of iceoryx2 depend on bindgen everywhere and call it on QNX only; the
//! workspace compiles this crate in its place, and eight others not at all.
