//! Texts from files as they may be printed.

use std::path::Path;

/// Longest path shown in a message, characters: PATH_MAX of Linux.
const LONGEST_PATH: usize = 4096;
/// Longest name or value shown in a message, characters.
const SHOWN: usize = 120;

/// Whether a terminal or an editor might take the character for a command, or show it so that the
/// text reads as another one.
#[must_use]
pub fn is_unprintable(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

/// A text with everything unprintable written as `\u{1b}`; line feeds stay.
#[must_use]
pub fn plain(text: &str) -> String {
    if !text.chars().any(|c| is_unprintable(c) && c != '\n') {
        return text.to_owned();
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            '\n' => out.push(c),
            '\t' => out.push(' '),
            c if is_unprintable(c) => out.extend(c.escape_unicode()),
            c => out.push(c),
        }
    }
    out
}

/// A name or value as it is shown in a message: on one line, printable, cut when long.
#[must_use]
pub fn shown(text: &str) -> String {
    let mut out: String = text.chars().take(SHOWN).collect();
    if out.len() < text.len() {
        out.pop();
        out.push('…');
    }
    plain(&out).replace('\n', "\\n")
}

/// A path as it is shown: printable, and only its end when it is longer than any system takes.
#[must_use]
pub fn shown_path(path: &Path) -> String {
    let text = path.to_string_lossy();
    let n = text.chars().count();
    if n <= LONGEST_PATH {
        return plain(&text).replace('\n', "\\n");
    }
    let end: String = text.chars().skip(n - LONGEST_PATH).collect();
    format!("…{}", plain(&end).replace('\n', "\\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_nothing_unprintable_is_shown() {
        assert_eq!(plain("a\u{1b}[31m\u{9b}\u{202e}b\nµ\tc"), "a\\u{1b}[31m\\u{9b}\\u{202e}b\nµ c");
        assert_eq!(shown("a\nb"), "a\\nb");
        assert_eq!(shown(&"µ".repeat(200)).chars().count(), SHOWN);
        assert_eq!(shown("short"), "short");
    }
}
