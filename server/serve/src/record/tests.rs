//! Recordings written and read without a server.

use std::fs;
use std::io::Cursor;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

use sarrus_models::{Options, Source, load};
use sarrus_proto::{Answer, Field, FieldSet, Query, Request, Status, Warnings};

use super::file::{RecordFile, segment_head};
use super::format::{
    BODY_HEAD, PAGE, QUERY_HEAD, SEGMENT_HEAD, WORD, checksum, join, words, write_query,
};
use super::header::Header;
use super::*;

const QUERY: Query =
    Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q]));

fn path(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("sarrus-file-{name}-{}", std::process::id()))
}

fn robot() -> RecordedRobot {
    RecordedRobot::new(&Source::Bundled("lambda".into()), &Options::default()).unwrap()
}

/// The number of record k: of another sign one lap of three segments later, so that its last
/// byte differs too.
fn number(k: u64) -> f64 {
    if (k / FRAMES).is_multiple_of(2) { 0.5 + k as f64 } else { -0.5 - k as f64 }
}

/// A body of the lambda elbow: one number in, three out.
fn body(sequence: u64, number: f64) -> Vec<u64> {
    let mut body = vec![1_000_000 * sequence, 0, join(5, 2), sequence, 0, join(1, 3)];
    body.resize(BODY_HEAD, 0);
    assert_eq!(write_query(&QUERY, &mut body[BODY_HEAD - QUERY_HEAD..]), QUERY_HEAD);
    body.extend([number; 4].map(f64::to_bits));
    body
}

/// A recording of `n` bodies in the smallest segments that there are, as bytes.
fn recorded(name: &str, n: u64) -> (Vec<u8>, Header) {
    let robot = serde_json::to_vec(&robot()).unwrap();
    let header = Header {
        run: 77,
        seconds: 1,
        robot: robot.len() as u64,
        robot_checksum: checksum(0, words(&robot)),
        segments: 3,
        segment: 4096,
        ..Header::default()
    };
    let path = path(name);
    let mut file = RecordFile::create(&path, header, &robot).unwrap();
    for k in 0..n {
        file.add(&body(k, number(k))).unwrap();
        if k % 3 == 0 {
            file.flush().unwrap();
        }
    }
    file.flush().unwrap();
    let bytes = fs::read(&path).unwrap();
    fs::remove_file(&path).unwrap();
    (bytes, header)
}

/// The sequences that are read, and the gaps.
fn sequences(bytes: &[u8]) -> (Vec<u64>, Gaps) {
    let mut found = Vec::new();
    let mut recording = Recording::open(Cursor::new(bytes)).unwrap();
    let gaps = recording
        .read(|entry, _| {
            let number = number(entry.sequence);
            assert_eq!((entry.plan, entry.client), (5, Client::Lane(2)));
            assert_eq!((entry.input, entry.output), (&[number][..], &[number; 3][..]));
            assert_eq!(entry.query, Some(QUERY));
            found.push(entry.sequence);
        })
        .unwrap();
    (found, gaps)
}

/// Bytes of one frame of [`body`].
const FRAME: usize = WORD * (4 + BODY_HEAD + 4);
/// Frames of a segment.
const FRAMES: u64 = ((4096 - WORD * SEGMENT_HEAD) / FRAME) as u64;

/// A sparse file with this header and as many heads of segments, and nothing behind each head.
fn hollow(header: Header, heads: u64) -> fs::File {
    let path = path("hollow");
    let file = fs::File::options().read(true).write(true).create_new(true).open(&path).unwrap();
    fs::remove_file(&path).unwrap();
    let robot = serde_json::to_vec(&robot()).unwrap();
    file.write_all_at(&header.to_bytes(), 0).unwrap();
    file.write_all_at(&robot, PAGE as u64).unwrap();
    file.set_len(header.segment_at(header.segments)).unwrap();
    for number in 1..=heads {
        let head = segment_head(header.run, number, 0).map(u64::to_le_bytes).concat();
        file.write_all_at(&head, header.segment_at(number - 1)).unwrap();
    }
    file
}

#[test]
fn a_forged_recording_with_holes_is_refused_in_bounded_work() {
    let (_, header) = recorded("forged", 1);
    let header = Header { segments: 1000, segment: 128 << 20, ..header };
    // segments that were never begun cost a look each
    let many = Header { segments: 1 << 14, segment: 64 << 20, ..header };
    let mut recording = Recording::open(hollow(many, 1)).unwrap();
    assert_eq!(recording.read(|_, _| {}).unwrap(), Gaps::default());
    let mut recording = Recording::open(hollow(header, 1000)).unwrap();
    let error = recording.read(|_, _| {}).unwrap_err();
    assert!(matches!(error, RecordingError::Holes(_)), "{error}");
}

#[test]
fn the_newest_records_stay_in_order_after_any_number_of_laps() {
    for n in (0..8 * FRAMES).step_by(7) {
        let (found, gaps) = sequences(&recorded("laps", n).0);
        let segment = n.div_ceil(FRAMES);
        let first = segment.saturating_sub(3) * FRAMES;
        assert_eq!(found, (first..n).collect::<Vec<_>>(), "{n}");
        assert_eq!(gaps, Gaps::default());
    }
}

#[test]
fn a_record_that_was_cut_off_at_any_byte_takes_no_other_with_it() {
    // the second lap of the segment: old bytes follow the cut
    let n = 4 * FRAMES + 3;
    let (bytes, header) = recorded("torn", n);
    let (before, _) = recorded("torn", n - 1);
    let start = header.segment_at(1) as usize + WORD * SEGMENT_HEAD + 2 * FRAME;
    for cut in 0..FRAME {
        let mut torn = before.clone();
        torn[start..start + cut].copy_from_slice(&bytes[start..start + cut]);
        let (found, gaps) = sequences(&torn);
        assert_eq!(found, (2 * FRAMES..n - 1).collect::<Vec<_>>(), "{cut}");
        assert_eq!(gaps.damaged, 0, "{cut}");
    }
    // the head of a segment that was just begun
    let n = 4 * FRAMES + 1;
    let (bytes, header) = recorded("torn", n);
    let (before, _) = recorded("torn", n - 1);
    let start = header.segment_at(1) as usize;
    for cut in 0..WORD * SEGMENT_HEAD {
        let mut torn = before.clone();
        torn[start..start + cut].copy_from_slice(&bytes[start..start + cut]);
        let (found, gaps) = sequences(&torn);
        assert_eq!((found.last(), gaps.damaged), (Some(&(n - 2)), 0), "{cut}");
    }
}

#[test]
fn any_changed_bit_of_a_record_is_counted_and_costs_that_record_alone() {
    let n = 2 * FRAMES;
    let (bytes, header) = recorded("flipped", n);
    let start = header.segment_at(0) as usize + WORD * SEGMENT_HEAD + 5 * FRAME;
    for bit in 0..8 * FRAME {
        let mut changed = bytes.clone();
        changed[start + bit / 8] ^= 1 << (bit % 8);
        let (found, gaps) = sequences(&changed);
        assert_eq!((found.len() as u64, gaps.damaged), (n - 1, 1), "{bit}");
        assert!(!found.contains(&5));
    }
}

#[test]
fn replay_finds_each_bit_that_comes_out_differently() {
    let loaded = load(&Source::Bundled("lambda".into()), &Options::default()).unwrap();
    let model = &loaded.compiled.model;
    let robot = serde_json::to_vec(&robot()).unwrap();
    let header = Header {
        fingerprint: model.fingerprint(),
        robot: robot.len() as u64,
        robot_checksum: checksum(0, words(&robot)),
        segments: 3,
        segment: 4096,
        ..Header::default()
    };
    // the right answer, then one with another bit
    let plan = sarrus_dynamics::Plan::new(model, &QUERY).unwrap();
    let mut workspace = sarrus_dynamics::Workspace::new(model);
    let mut output = [0.0; 3];
    let answer = plan.run(model, &mut workspace, &[0.1], &mut output);
    assert_eq!(answer, Answer { status: Status::Ok, warnings: Warnings::NONE });
    let mut right = body(1, 0.1);
    right.truncate(BODY_HEAD + 1);
    right.extend(output.map(f64::to_bits));
    let mut wrong = right.clone();
    let mut failed = right.clone();
    wrong[BODY_HEAD + 2] ^= 5;
    failed[4] = join(Status::Unreachable as u32, 0);
    let path = path("differing");
    let mut file = RecordFile::create(&path, header, &robot).unwrap();
    for body in [&right, &wrong, &right, &failed] {
        file.add(body).unwrap();
    }
    file.flush().unwrap();
    let mut recording = Recording::open(fs::File::open(&path).unwrap()).unwrap();
    let replayed = replay(&mut recording, model, |_| ()).unwrap();
    assert_eq!((replayed.requests, replayed.differing_answers), (4, 2));
    let bits = 2 + (Status::Unreachable as u32).count_ones();
    assert_eq!(replayed.differing_bits, u64::from(bits));
    let fields = replayed.differences.iter().map(|found| found.field.as_str());
    assert_eq!(fields.collect::<Vec<_>>(), ["q[1]", "status"]);
    assert!(!replayed.is_same());
    assert_ne!(replayed.differences[0].recorded, replayed.differences[0].computed);

    // on another robot nothing is computed
    let other = recording.robot().load_as(&Source::Bundled("torso".into())).unwrap();
    let refused = replay(&mut recording, &other.compiled.model, |_| ());
    assert!(matches!(refused, Err(RecordingError::WrongModel { .. })));
    fs::remove_file(&path).unwrap();
}

#[test]
fn a_query_comes_back_with_all_its_links() {
    let wide = QUERY.with_frames(&[1, 2, 3, 4, 5]).with_wrenches(&[9, 8]);
    for query in [QUERY, wide, QUERY.with_frames(&[65_535; 32]).with_wrenches(&[7; 16])] {
        let mut words = [0; 30];
        let n = write_query(&query, &mut words);
        assert_eq!(format::read_query(&words[..n]), Some((Some(query), n)));
        assert_eq!(format::read_query(&words[..n - 1]), None);
    }
}

/// Numbers of any kind, the same each time: Knuth's MMIX.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(0x1405_7b7e_f767_814f);
        self.0 >> 20
    }

    /// A word that might break a reader.
    fn word(&mut self) -> u64 {
        match self.next() % 8 {
            0 => 0,
            1 => u64::MAX,
            2 => self.next() % 40,
            3 => join((self.next() % 5) as u32, (self.next() % 7) as u32),
            4 => 1 << (self.next() % 64),
            5 => self.next() % 5000,
            6 => f64::to_bits(0.1),
            _ => self.next().wrapping_mul(0x9e37_79b9_7f4a_7c15),
        }
    }
}

/// Reads and computes all readable records of bytes; false if there are none.
fn survives(bytes: &[u8], model: &Model<f64>) -> bool {
    let Ok(mut recording) = Recording::open(Cursor::new(bytes)) else { return false };
    let _ = recording.robot().load();
    replay(&mut recording, model, |_| ()).is_ok_and(|replayed| replayed.requests > 0)
}

#[test]
fn no_bytes_are_too_strange_to_be_read_or_refused() {
    let loaded = load(&Source::Bundled("lambda".into()), &Options::default()).unwrap();
    let model = &loaded.compiled.model;
    let mut random = Random(0x5a44);
    let (good, header) = recorded("strange", 40);
    let seal = |header: Header| {
        let mut bytes = header.to_bytes();
        bytes.extend(&good[PAGE..]);
        bytes
    };
    let fingerprint = model.fingerprint();
    let header = Header { fingerprint, ..header };
    assert!(survives(&seal(header), model));

    // bits, bytes and lengths
    for _ in 0..3000 {
        let mut bytes = seal(header);
        for _ in 0..1 + random.next() % 4 {
            let at = random.next() as usize % bytes.len();
            bytes[at] = random.next() as u8;
        }
        if random.next().is_multiple_of(4) {
            bytes.truncate(random.next() as usize % bytes.len());
        }
        survives(&bytes, model);
    }
    // sound headers of any content
    for _ in 0..3000 {
        let mut strange = header;
        match random.next() % 7 {
            0 => strange.robot = random.word(),
            1 => strange.robot_checksum = random.word(),
            2 => strange.segments = random.word(),
            3 => strange.segment = random.word(),
            4 => strange.run = random.word(),
            5 => strange.segment = 4096 << (random.next() % 50),
            _ => (strange.segments, strange.seconds) = (random.word() % 9, random.word()),
        }
        survives(&seal(strange), model);
    }
    // sound frames of any content
    let mut any = false;
    for _ in 0..300 {
        let path = path("strange");
        let robot = &good[PAGE..PAGE + header.robot as usize];
        let mut file = RecordFile::create(&path, header, robot).unwrap();
        for k in 0..60 {
            let mut body = body(k, 0.1);
            for _ in 0..random.next() % 4 {
                let at = random.next() as usize % body.len();
                body[at] = random.word();
            }
            body.truncate(random.next() as usize % 60);
            file.add(&body).unwrap();
        }
        file.flush().unwrap();
        any |= survives(&fs::read(&path).unwrap(), model);
        fs::remove_file(&path).unwrap();
    }
    assert!(any);
}
