//! Laws of every report: each message is one line of bounded length, and its place lies in the file
//! that it names.

use sarrus_models::{Diagnostic, Report};

use super::{kind, law};

/// The longest line of a report, in characters.
const LONGEST: usize = 400;

/// Checks a report about the named files and returns the kind of its outcome.
pub(super) fn check(report: &Report, files: &[(&str, &[u8])]) -> Result<u64, String> {
    let mut kinds = 0_u64;
    for diagnostic in report.errors.iter().chain(&report.warnings) {
        check_one(diagnostic, files)?;
        // order and repetitions do not count
        kinds |= 1 << (kind(&diagnostic.found) % 64);
    }
    Ok(kinds ^ (report.errors.len().min(3) as u64) << 62)
}

fn check_one(diagnostic: &Diagnostic, files: &[(&str, &[u8])]) -> Result<(), String> {
    let line = diagnostic.to_string();
    let about = |words: &str| format!("{words}: {line:?}");
    law(!line.contains('\n') && !line.contains('\r'), || about("a diagnostic of several lines"))?;
    let file_name = diagnostic.file.chars().count();
    law(line.chars().count() - file_name <= LONGEST, || about("a diagnostic that is too long"))?;
    law(!line.chars().any(char::is_control), || about("a diagnostic with control characters"))?;
    law(!diagnostic.found.is_empty(), || about("a diagnostic that found nothing"))?;

    // a place in the text, or just behind the end of its line
    let Some((_, bytes)) = files.iter().find(|(name, _)| *name == diagnostic.file) else {
        return Err(about("a diagnostic on another file"));
    };
    let text = String::from_utf8_lossy(bytes);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let on_line = text.split('\n').nth(diagnostic.line.wrapping_sub(1));
    let columns = on_line.map_or(0, |line| line.chars().count() + 1);
    law((1..=columns).contains(&diagnostic.column), || about("a place outside of the text"))
}
