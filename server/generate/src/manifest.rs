//! The manifest of a shared object: its robot, its query and its compiler.
//!
//! It is text that stands in the object as it is, so that it can be read off the file before
//! anything of it is loaded. Only objects that sarrus compiles have it: the C source leaves it out
//! unless `SARRUS_SHARED_OBJECT` is defined.

use sarrus_dynamics::{FieldSet, MOST_ROWS, Query, Request};
use sarrus_proto::Tolerance;

use crate::Kernel;

/// The first line: a magic number and the revision of this text and of the C that is written. It
/// is raised with every change of either, from the function's arguments to the conditions under
/// which it answers; objects of another revision are refused, and made again where they are kept.
pub(crate) const HEAD: &str = "sarrus kernel 6\n";
/// The symbol of the text.
pub(crate) const SYMBOL: &str = "sarrus_kernel";
/// The definition under which the text is compiled.
pub(crate) const DEFINITION: &str = "SARRUS_SHARED_OBJECT";
/// No text is longer.
const LONGEST: usize = 4096;
/// Instructions beyond the oldest processor's that an object may need, by the macros under which
/// compilers use them.
const INSTRUCTIONS: [(&str, &str); 3] =
    [("__FMA__", "fma"), ("__AVX2__", "avx2"), ("__AVX512F__", "avx512f")];

/// The manifest of a shared object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Manifest {
    /// The name of the function.
    pub function: String,
    /// The robot's name, in ASCII.
    pub robot: String,
    /// The fingerprint of the robot's description, as on the wire.
    pub fingerprint: u64,
    /// The query, without options that mathematics does not see.
    pub query: Query,
    /// How many numbers go in, with those that [`sarrus_dynamics::Plan::close`] adds.
    pub inputs: usize,
    /// How many numbers come out.
    pub outputs: usize,
    /// How many states the function for rows answers at once; 0 where there is none.
    pub rows: usize,
    /// The version of sarrus that wrote the C.
    pub generator: String,
    /// The instructions that the compiler could take for granted: names such as `fma avx2`.
    pub processor: String,
    /// The compiler's version; empty in a text that was not compiled.
    pub compiler: String,
}

impl Manifest {
    /// Of a kernel whose function has this name. Allocates.
    pub(crate) fn of(kernel: &Kernel, function: &str) -> Manifest {
        Manifest {
            function: function.to_owned(),
            robot: plain(&kernel.info.robot),
            fingerprint: kernel.info.fingerprint,
            query: bare_query(kernel.plan.query()),
            inputs: kernel.inputs(),
            outputs: kernel.plan.want().len(),
            rows: 0,
            generator: env!("CARGO_PKG_VERSION").to_owned(),
            processor: String::new(),
            compiler: String::new(),
        }
    }

    /// Finds and reads the text in the bytes of an object; with it its bytes.
    pub(crate) fn find(bytes: &[u8]) -> Option<(Manifest, &[u8])> {
        let head = HEAD.as_bytes();
        let start = bytes.windows(head.len()).position(|window| window == head)?;
        let rest = bytes.get(start..)?;
        let text = rest.get(..rest.iter().take(LONGEST).position(|byte| *byte == 0)?)?;
        let manifest = Manifest::parse(std::str::from_utf8(text).ok()?)?;
        Some((manifest, text))
    }

    fn parse(text: &str) -> Option<Manifest> {
        let mut lines = text.strip_prefix(HEAD)?.lines();
        let mut value = |key: &str| lines.next()?.strip_prefix(key)?.strip_prefix(' ');
        Some(Manifest {
            function: value("function")?.to_owned(),
            robot: value("robot")?.to_owned(),
            fingerprint: u64::from_str_radix(value("fingerprint")?, 16).ok()?,
            query: query_of(value("query")?)?,
            inputs: value("inputs")?.parse().ok()?,
            outputs: value("outputs")?.parse().ok()?,
            rows: value("rows")?.parse().ok().filter(|rows| *rows <= MOST_ROWS)?,
            generator: value("generator")?.to_owned(),
            processor: value("processor")?.trim_end().to_owned(),
            compiler: value("compiler")?.to_owned(),
        })
    }

    /// The instructions that it needs and the running processor lacks, or that this build does not
    /// know.
    #[cfg(feature = "load")]
    pub(crate) fn missing_instructions(&self) -> Vec<&str> {
        self.processor.split_whitespace().filter(|name| !has_instruction(name)).collect()
    }

    /// The text as a constant in C; the compiler adds the instruction sets it may use and its
    /// version.
    pub(crate) fn c(&self) -> String {
        let lines = [
            HEAD.trim_end().to_owned(),
            format!("function {}", self.function),
            format!("robot {}", self.robot),
            format!("fingerprint {:016x}", self.fingerprint),
            format!("query {}", query_text(&self.query)),
            format!("inputs {}", self.inputs),
            format!("outputs {}", self.outputs),
        ];
        let line = |line: &str| format!("    \"{line}\\n\"\n");
        let lines: String = lines.iter().map(|text| line(text)).collect();
        let generator = line(&format!("generator {}", self.generator));
        let instruction = |(macro_name, name): (&str, &str)| {
            format!("#ifdef {macro_name}\n    \"{name} \"\n#endif\n")
        };
        let instructions: String = INSTRUCTIONS.map(instruction).concat();
        // how many rows is known where the function for them is compiled
        include_str!("c/manifest.c")
            .replace("@DEFINITION@", DEFINITION)
            .replace("@SYMBOL@", SYMBOL)
            .replace("@GENERATOR@", &generator)
            .replace("@INSTRUCTIONS@", &instructions)
            .replace("@LINES@", &lines)
    }
}

/// Whether the running processor, and its system, have it.
#[cfg(feature = "load")]
fn has_instruction(name: &str) -> bool {
    #[cfg(target_arch = "x86_64")]
    let has = match name {
        "fma" => std::is_x86_feature_detected!("fma"),
        "avx2" => std::is_x86_feature_detected!("avx2"),
        "avx512f" => std::is_x86_feature_detected!("avx512f"),
        _ => false,
    };
    #[cfg(not(target_arch = "x86_64"))]
    let has = {
        let _ = name;
        false
    };
    has
}

/// The query without the options that do not change its numbers: the query that a kernel is made
/// for.
pub fn bare_query(query: &Query) -> Query {
    Query { options: query.options.of_numbers(), ..*query }
}

/// Text that can stand in a string and in a comment of C.
fn plain(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || " _-.+:".contains(c);
    text.chars().take(80).map(|c| if is_plain(c) { c } else { '_' }).collect()
}

/// A query as one line: numbers in hexadecimal, lists after their names.
pub(crate) fn query_text(query: &Query) -> String {
    let bounds = [query.loop_tolerance, query.projection_tolerance].map(|tolerance| tolerance.0);
    let mut text = format!("{:x} {:x} {:x}", query.request, query.given.0, query.want.0);
    bounds.iter().for_each(|bits| text += &format!(" {bits:x}"));
    text += &format!(" {:x} {:x}", query.axes, query.relative_to);
    text += " frames";
    query.frames().iter().for_each(|link| text += &format!(" {link:x}"));
    text += " wrenches";
    query.wrench_links().iter().for_each(|link| text += &format!(" {link:x}"));
    text += " joints";
    query.joint_runs().iter().for_each(|[from, to]| text += &format!(" {from:x} {to:x}"));
    text
}

/// The query of such a line. Whether it fits a robot is for [`Query::check`].
fn query_of(text: &str) -> Option<Query> {
    let (numbers, lists) = text.split_once(" frames")?;
    let (frames, lists) = lists.split_once(" wrenches")?;
    let (wrenches, joints) = lists.split_once(" joints")?;
    let wide = |word: &str| u128::from_str_radix(word, 16).ok();
    let list = |text: &str| -> Option<Vec<u16>> {
        text.split_whitespace().map(|word| u16::from_str_radix(word, 16).ok()).collect()
    };
    let numbers: Option<Vec<u128>> = numbers.split_whitespace().map(wide).collect();
    let [request, given, want, loop_tolerance, projection_tolerance, axes, relative_to] =
        *numbers?.as_slice()
    else {
        return None;
    };
    let request = Request::from_code(request.try_into().ok()?)?;
    let mut query = Query::new(request, FieldSet(given), FieldSet(want));
    query = query.with_frames(&list(frames)?);
    let wrenches = list(wrenches)?;
    if !wrenches.is_empty() {
        query = query.with_wrenches(&wrenches);
    }
    let joints = list(joints)?;
    for (k, run) in joints.chunks(2).enumerate() {
        *query.joints.get_mut(k)? = [*run.first()?, *run.get(1)?];
        query.n_joint_runs += 1;
    }
    (query.axes, query.relative_to) = (axes.try_into().ok()?, relative_to.try_into().ok()?);
    query.loop_tolerance = Tolerance(loop_tolerance.try_into().ok()?);
    query.projection_tolerance = Tolerance(projection_tolerance.try_into().ok()?);
    (query_text(&query) == text).then_some(query)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use sarrus_dynamics::Field;
    use sarrus_proto::{Axes, QueryOptions};

    use super::*;

    #[test]
    fn a_query_is_read_again_from_its_line() {
        let fields = FieldSet::of(&[Field::Y, Field::Yd]);
        let query = Query::new(Request::Kinematics, fields, FieldSet::of(&[Field::FramePose]))
            .with_frames(&[3, 17])
            .with_wrenches(&[5])
            .with_joints([0, 1, 2, 7, 9])
            .with_loop_tolerance(1e-4)
            .with_axes(Axes::Local)
            .relative_to(4);
        assert_eq!(query_of(&query_text(&query)), Some(query));
        let checked = query.with_options(QueryOptions::CHECKSUM);
        assert_eq!(bare_query(&checked), query);
        for text in ["", "1 2 3", "1 7 400 0 0 frames wrenches joints 1", "x 7 4 0 0 frames"] {
            assert_eq!(query_of(text), None, "{text}");
        }
    }

    #[test]
    fn a_manifest_is_found_among_other_bytes() {
        let query = Query::new(Request::Kinematics, FieldSet(1), FieldSet(2));
        let manifest = Manifest {
            function: "arm_kinematics".to_owned(),
            robot: plain("arm \"\u{e9}\\"),
            fingerprint: 0xfeed,
            query,
            inputs: 3,
            outputs: 4,
            rows: 0,
            generator: "0.1.0".to_owned(),
            processor: "fma avx2".to_owned(),
            compiler: "12.2.0".to_owned(),
        };
        // the constant as a compiler would put it together that has no vectors
        let c = manifest.c().replace("\"rows \" ", "");
        let lines = c.lines().filter_map(|line| line.trim().strip_prefix('"'));
        let lines = lines.filter_map(|line| line.strip_suffix("\\n\""));
        let mut text: String = lines.map(|line| format!("{line}\n")).collect();
        text += "processor fma avx2 \ncompiler 12.2.0\n";
        let bytes = [b"\x7fELF", text.as_bytes(), b"\0rest"].concat();
        assert_eq!(Manifest::find(&bytes), Some((manifest, text.as_bytes())));
        assert_eq!(Manifest::find(text.as_bytes()), None);
        assert_eq!(Manifest::find(b"sarrus kernel 1\nfunction f\0"), None);
    }
}
