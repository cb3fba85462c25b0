//! `NAME.cu` or `NAME.cl`: a kernel over a batch of states. `NAME_launch`: a program that runs it.

use sarrus_dynamics::Model;

use crate::Kernel;
use crate::c::test;

/// The language of a kernel for devices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Device {
    /// CUDA.
    Cuda,
    /// OpenCL C 1.2, with doubles.
    OpenCl,
}

/// A kernel over batches, number by number, and a program that launches it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Launcher {
    /// Its language.
    pub device: Device,
    /// `NAME.cu` or `NAME.cl`: the kernel `NAME_kernel`, which includes `NAME.c`.
    pub kernel: String,
    /// `NAME_launch.cu` or `NAME_launch.c`: a program that ends with 0 where every answer of a
    /// device has the generic kernel's bits, and with 2 where there is no device.
    pub launch: String,
}

impl Launcher {
    pub(super) fn new(kernel: &Kernel, model: &Model<f64>, name: &str, device: Device) -> Launcher {
        let text = match device {
            Device::Cuda => include_str!("launch_cuda.c"),
            Device::OpenCl => include_str!("launch_opencl.c"),
        };
        let launch = include_str!("launch.c").replace("@DEVICE@", text);
        let [kernel, launch] =
            [include_str!("kernel.c"), &launch].map(|text| test::filled(text, kernel, model, name));
        Launcher { device, kernel, launch }
    }

    /// The endings of its files.
    pub(crate) fn endings(&self) -> [&'static str; 2] {
        match self.device {
            Device::Cuda => [".cu", "_launch.cu"],
            Device::OpenCl => [".cl", "_launch.c"],
        }
    }
}
