//! `NAME.cu` or `NAME.cl`: a kernel over a batch of states. `NAME_launch`: a program that runs it.

use std::path::{Path, PathBuf};
use std::process::Command;

use sarrus_dynamics::Model;

use crate::Kernel;
use crate::c::{Source, test};
use crate::compiler::{COMPILE, first_line, usual, write_all};
use crate::error::BuildError;
use crate::run::{Cancel, run};

/// The language of a kernel for devices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Device {
    /// CUDA.
    Cuda,
    /// OpenCL C 1.2, with doubles.
    OpenCl,
}

/// A kernel over batches, number by number, and a program that launches it. Both include files of
/// [`Launcher::source`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Launcher {
    /// The function as C, in an order for devices.
    pub source: Source,
    /// `NAME.cu` or `NAME.cl`: the kernel `NAME_kernel`.
    pub kernel: String,
    /// `NAME_launch.cu` or `NAME_launch.c`: a program that ends with 0 where every answer of a
    /// device has the generic kernel's bits, and with 2 where there is no device.
    pub launch: String,
    device: Device,
}

impl Launcher {
    /// For a kernel of this model under this name, as [`Source::new`]. Allocates.
    pub fn new(kernel: &Kernel, model: &Model<f64>, name: &str, device: Device) -> Launcher {
        let source = Source::ordered(kernel, model, name, true);
        let text = match device {
            Device::Cuda => include_str!("launch_cuda.c"),
            Device::OpenCl => include_str!("launch_opencl.c"),
        };
        let launch = include_str!("launch.c").replace("@DEVICE@", text);
        Launcher {
            kernel: test::filled(include_str!("kernel.c"), kernel, model, &source.name),
            launch: test::filled(&launch, kernel, model, &source.name),
            source,
            device,
        }
    }

    /// Writes the kernel and the program into the folder of the source; their paths.
    ///
    /// # Errors
    /// [`BuildError::Io`]: some file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, BuildError> {
        let endings = match self.device {
            Device::Cuda => [".cu", "_launch.cu"],
            Device::OpenCl => [".cl", "_launch.c"],
        };
        let files = [(endings[0], &self.kernel), (endings[1], &self.launch)];
        write_all(folder, &self.source.name, &files)
    }

    /// Builds the program that [`Launcher::write`] wrote, with the compiler `NVCC`, or `nvcc`, for
    /// CUDA and with `CC` for OpenCL, and runs it, each for at most 120 s. Its output, with the
    /// registers and spills of the kernel where the compiler prints them, or why it was not run.
    ///
    /// # Errors
    /// [`BuildError`]: some bit is another, it takes too long, or was cancelled.
    pub fn test(&self, folder: &Path, cancel: &Cancel) -> Result<String, BuildError> {
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let program = folder.join(format!("{}_launch", self.source.name));
        let (compiler, ending, flags) = match self.device {
            Device::Cuda => (usual("NVCC", "nvcc"), "cu", &["-fmad=false", "-Xptxas", "-v"][..]),
            Device::OpenCl => (usual("CC", "cc"), "c", &["-std=c11", "-lOpenCL"][..]),
        };
        let mut words = compiler.split_whitespace();
        let mut command = Command::new(words.next().unwrap_or_default());
        command.args(words).arg(program.with_extension(ending)).arg("-o").arg(&program).args(flags);
        let mut text = String::new();
        match run(&mut command, &compiler, COMPILE, cancel) {
            Ok(built) if built.is_success => {
                let is_size = |line: &&str| line.contains("registers") || line.contains("spill");
                let lines = built.words.lines().filter(is_size);
                lines.for_each(|line| text += &format!("{}\n", line.trim()));
            }
            Ok(failed) => return Ok(format!("not run: {compiler}: {}", first_line(&failed.words))),
            Err(BuildError::Cancelled) => return Err(BuildError::Cancelled),
            Err(error) => return Ok(format!("not run: {error}")),
        }
        let name = program.display().to_string();
        let ended = run(Command::new(&program).current_dir(folder), &name, COMPILE, cancel)?;
        match ended.code {
            Some(0) => Ok(text + &ended.words),
            Some(2) => Ok(text + "not run: " + &ended.words),
            _ => Err(BuildError::Failed { program: name, words: ended.words }),
        }
    }
}
