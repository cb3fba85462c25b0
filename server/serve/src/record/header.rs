//! The first page of a recording: its server, and the layout of the file.

use super::error::RecordingError;
use super::format::{
    BODY_HEAD, FORMAT, FRAME_HEAD, HEADER, MAGIC, MAX_FRAME, PAGE, SEGMENT_HEAD, WORD, checksum,
    word, words,
};

/// Segments of a small recording.
const SEGMENTS: u64 = 16;
/// About the most bytes of a segment; a longer recording has more of them.
const LARGE: u64 = 64 << 20;
/// No segment of a recording is larger.
const LARGEST: u64 = 128 << 20;
/// Most segments, whose heads are read one by one: 128 TiB of long ones.
const MOST_SEGMENTS: u64 = 1 << 21;
/// Most bytes of the robot, which is read into memory.
const MOST_ROBOT: u64 = 512 << 20;
/// The rate of requests for which each lane has room `[1/s]`.
const RATE: u64 = 1000;

/// The header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Header {
    /// Version of the protocol of the server.
    pub(super) protocol: u64,
    /// Fingerprint of the model.
    pub(super) fingerprint: u64,
    /// Time 0 of the records, since 1970 `[ns]`.
    pub(super) start: u64,
    /// The requested length `[s]`.
    pub(super) seconds: u64,
    /// Identifies the recording; every checksum of the segments depends on it.
    pub(super) run: u64,
    /// Bytes of the robot and their checksum.
    pub(super) robot: u64,
    pub(super) robot_checksum: u64,
    /// Number of segments, and the bytes of each.
    pub(super) segments: u64,
    pub(super) segment: u64,
}

impl Header {
    /// Adds segments for `seconds` of requests at 1 kHz through each of `lanes`, of `numbers`
    /// numbers with their answers; `None` if they are too many.
    ///
    /// One segment is always being overwritten, so the others hold all of it; each may lack room
    /// for its last frame.
    pub(super) fn sized(self, lanes: u64, numbers: u64) -> Option<Header> {
        let frame = (WORD as u64).checked_mul((FRAME_HEAD + BODY_HEAD) as u64 + numbers)?;
        let rate = lanes.max(1) * RATE;
        let needed = self.seconds.checked_mul(rate)?.checked_mul(frame)?;
        let segments = (needed / LARGE + 2).max(SEGMENTS);
        let least =
            (needed / (segments - 1)).checked_add((MAX_FRAME + WORD * SEGMENT_HEAD) as u64)?;
        let segment = least.checked_next_multiple_of(PAGE as u64)?;
        Some(Header { segments, segment, ..self }).filter(|header| header.file().is_some())
    }

    /// Offset of a segment.
    pub(super) fn segment_at(&self, index: u64) -> u64 {
        self.first() + index * self.segment
    }

    /// Bytes of the file; `None` if that is more than any recording has.
    pub(super) fn file(&self) -> Option<u64> {
        if self.segments > MOST_SEGMENTS || self.robot > MOST_ROBOT {
            return None;
        }
        let robot = self.robot.checked_add(2 * PAGE as u64)?;
        robot.checked_add(self.segments.checked_mul(self.segment)?)?;
        Some(self.segment_at(self.segments))
    }

    fn first(&self) -> u64 {
        PAGE as u64 + self.robot.next_multiple_of(PAGE as u64)
    }

    /// The page.
    pub(super) fn to_bytes(self) -> Vec<u8> {
        let Header { protocol, fingerprint, start, seconds, run, .. } = self;
        let Header { robot, robot_checksum, segments, segment, .. } = self;
        let mut all = vec![MAGIC, FORMAT, protocol, fingerprint, start, seconds, run];
        all.extend([robot, robot_checksum, segments, segment]);
        all.push(checksum(MAGIC, all.iter().copied()));
        let mut page: Vec<u8> = all.iter().flat_map(|word| word.to_le_bytes()).collect();
        page.resize(PAGE, 0);
        page
    }

    /// Reads a page.
    ///
    /// # Errors
    /// [`RecordingError`] unless the page is a header of this version.
    pub(super) fn read(page: &[u8]) -> Result<Header, RecordingError> {
        if word(page, 0) != MAGIC {
            return Err(RecordingError::Foreign);
        }
        if word(page, 1) != FORMAT {
            return Err(RecordingError::Format(word(page, 1)));
        }
        let checked = page.get(..WORD * (HEADER - 1)).unwrap_or_default();
        if word(page, HEADER - 1) != checksum(MAGIC, words(checked)) {
            return Err(RecordingError::Header);
        }
        let [protocol, fingerprint, start, seconds, run, robot, robot_checksum, segments, segment] =
            std::array::from_fn(|k| word(page, k + 2));
        let header = Header {
            protocol,
            fingerprint,
            start,
            seconds,
            run,
            robot,
            robot_checksum,
            segments,
            segment,
        };
        // more segments than usual are long ones
        let is_sound = (segments <= SEGMENTS || segment >= LARGE / 2)
            && segments >= 2
            && (PAGE as u64..=LARGEST).contains(&segment)
            && segment.is_multiple_of(PAGE as u64)
            && header.file().is_some();
        if is_sound { Ok(header) } else { Err(RecordingError::Header) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_comes_back_and_any_changed_bit_is_found() {
        let header = Header { seconds: 60, robot: 5000, run: 9, ..Header::default() };
        let header = header.sized(16, 100).unwrap();
        let page = header.to_bytes();
        assert_eq!(Header::read(&page).unwrap(), header);
        for bit in 0..8 * WORD * HEADER {
            let mut changed = page.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(Header::read(&changed).is_err(), "{bit}");
        }
        assert!(Header::read(&[]).is_err() && Header::read(&page[..90]).is_err());
    }

    #[test]
    fn a_header_of_more_than_can_be_read_is_refused() {
        let header = Header { segments: 3, segment: PAGE as u64, ..Header::default() };
        let is_read = |header: Header| Header::read(&header.to_bytes()).is_ok();
        assert!(is_read(header));
        for segments in [SEGMENTS + 1, MOST_SEGMENTS + 1, 1 << 40, u64::MAX / PAGE as u64] {
            assert!(!is_read(Header { segments, ..header }));
        }
        assert!(is_read(Header { segments: MOST_SEGMENTS, segment: LARGE, ..header }));
        assert!(!is_read(Header { segments: MOST_SEGMENTS + 1, segment: LARGE, ..header }));
        assert!(!is_read(Header { robot: MOST_ROBOT + 1, ..header }));
    }

    #[test]
    fn all_segments_but_one_hold_what_was_asked() {
        for (seconds, lanes, numbers) in
            [(1, 1, 10), (60, 16, 90), (3600, 16, 90), (86_400, 256, 500)]
        {
            let header = Header { seconds, ..Header::default() };
            let header = header.sized(lanes, numbers).unwrap();
            let frames =
                (header.segment - 32) / (8 * (FRAME_HEAD + BODY_HEAD) as u64 + 8 * numbers);
            assert!(frames * (header.segments - 1) >= seconds * lanes * 1000);
            assert!(header.segment <= LARGEST);
        }
        let endless = Header { seconds: u64::MAX, ..Header::default() };
        assert_eq!(endless.sized(16, 90), None);
    }
}
