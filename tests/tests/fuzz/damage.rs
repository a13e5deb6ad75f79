//! Damage to texts at the level of their numbers, words and lines, and to bytes.

use core::ops::Range;

use crate::dice::Dice;

/// What stands in for a number.
const NUMBERS: [&str; 40] = [
    "0",
    "-1",
    "-0.0",
    "1e308",
    "-1e308",
    "nan",
    "inf",
    "-inf",
    "NaN",
    "1e-320",
    "1e-12",
    "1e-9",
    "1e-6",
    "1e-4",
    "1e-3",
    "0.01",
    "0.1",
    "0.5",
    "1",
    "2",
    "3",
    "5",
    "12",
    "60",
    "89.9",
    "180",
    "1e3",
    "1e4",
    "1e5",
    "1e6",
    "1e7",
    "1e8",
    "1e9",
    "1e12",
    "4294967296",
    "1_0",
    "0x7f",
    "true",
    "\"text\"",
    "[]",
];
/// By what a number is multiplied: units taken for others, and a little off.
const FACTORS: [f64; 16] = [
    -1.0, 1e-6, 1e-3, 1e-2, 0.1, 0.5, 0.9, 0.999_999, 1.000_001, 1.1, 2.0, 10.0, 57.295_78, 1e3,
    1e4, 1e6,
];
/// What is put between.
const WORDS: [&str; 24] = [
    "\u{1b}[31m",
    "\0",
    "é",
    "\u{202e}",
    "\"",
    "'",
    "[",
    "]",
    "{",
    "}",
    "<",
    ">",
    "&",
    "=",
    "\n",
    "#",
    ".",
    "&#x9b;",
    "<!--",
    "-->",
    "<![CDATA[",
    "\"\"\"",
    "[[",
    ",",
];

/// Damages a text in up to eight places; `others` are texts of the same kind.
pub(crate) fn text(good: &[u8], others: &[&[u8]], dice: &mut Dice<'_>) -> Vec<u8> {
    let mut b = good.to_vec();
    for _ in 0..8 {
        if dice.spent() || b.is_empty() {
            break;
        }
        match dice.below(16) {
            0..4 => put_number(&mut b, dice),
            4..6 => scale_number(&mut b, dice),
            6 => exchange(&mut b, &numbers, dice),
            7 => exchange(&mut b, &words, dice),
            8 => copy_over(&mut b, &words, dice),
            9 => exchange(&mut b, &lines, dice),
            10 => remove_line(&mut b, dice),
            11 => insert_line(&mut b, others, dice),
            12 => {
                let at = dice.below(b.len());
                b.splice(at..at, dice.of(&WORDS).bytes());
            }
            13 => copy_over(&mut b, &numbers, dice),
            14 => bytes_once(&mut b, dice),
            _ => remove_block(&mut b, dice),
        }
    }
    b
}

fn is_number(c: u8) -> bool {
    c.is_ascii_digit() || matches!(c, b'.' | b'-' | b'e' | b'+')
}

/// Places of numbers: behind a blank, a quote, a bracket or a comma.
fn numbers(b: &[u8]) -> Vec<Range<usize>> {
    let begins = |i: usize| {
        (b[i].is_ascii_digit() || b[i] == b'-') && matches!(b[i - 1], b' ' | b'"' | b'[' | b',')
    };
    let end = |at: usize| (at..b.len()).find(|i| !is_number(b[*i])).unwrap_or(b.len());
    (1..b.len()).filter(|i| begins(*i)).map(|i| i..end(i)).collect()
}

fn words(b: &[u8]) -> Vec<Range<usize>> {
    let part = |c: u8| c.is_ascii_alphanumeric() || c == b'_';
    let (mut out, mut at) = (Vec::new(), 0);
    while at < b.len() {
        let end = (at..b.len()).find(|i| !part(b[*i])).unwrap_or(b.len());
        if end > at {
            out.push(at..end);
        }
        at = end + 1;
    }
    out
}

fn lines(b: &[u8]) -> Vec<Range<usize>> {
    let mut at = 0;
    let line = |l: &[u8]| {
        let place = at..at + l.len();
        at += l.len();
        place
    };
    b.split_inclusive(|c| *c == b'\n').map(line).collect()
}

fn put_number(b: &mut Vec<u8>, dice: &mut Dice<'_>) {
    let all = numbers(b);
    if !all.is_empty() {
        let at = dice.of(&all).clone();
        b.splice(at, dice.of(&NUMBERS).bytes());
    }
}

fn scale_number(b: &mut Vec<u8>, dice: &mut Dice<'_>) {
    let all = numbers(b);
    if all.is_empty() {
        return;
    }
    let at = dice.of(&all).clone();
    let x = core::str::from_utf8(&b[at.clone()]).ok().and_then(|t| t.parse::<f64>().ok());
    let new = format!("{:?}", x.unwrap_or(1.0) * dice.of(&FACTORS));
    b.splice(at, new.into_bytes());
}

/// Where the parts of a text are.
type Parts<'a> = &'a dyn Fn(&[u8]) -> Vec<Range<usize>>;

fn exchange(b: &mut Vec<u8>, parts: Parts<'_>, dice: &mut Dice<'_>) {
    let all = parts(b);
    if all.is_empty() {
        return;
    }
    let (i, j) = (dice.below(all.len()), dice.below(all.len()));
    if i == j {
        return;
    }
    let (first, second) = (all[i.min(j)].clone(), all[i.max(j)].clone());
    let (x, y) = (b[first.clone()].to_vec(), b[second.clone()].to_vec());
    b.splice(second, x);
    b.splice(first, y);
}

fn copy_over(b: &mut Vec<u8>, parts: Parts<'_>, dice: &mut Dice<'_>) {
    let all = parts(b);
    if !all.is_empty() {
        let from = b[dice.of(&all).clone()].to_vec();
        b.splice(dice.of(&all).clone(), from);
    }
}

fn remove_line(b: &mut Vec<u8>, dice: &mut Dice<'_>) {
    let all = lines(b);
    b.drain(dice.of(&all).clone());
}

fn insert_line(b: &mut Vec<u8>, others: &[&[u8]], dice: &mut Dice<'_>) {
    let from = *dice.of(others);
    let theirs = lines(from);
    let line = from[dice.of(&theirs).clone()].to_vec();
    let ours = lines(b);
    let at = dice.of(&ours).start;
    b.splice(at..at, line);
}

/// Some lines in a row.
fn remove_block(b: &mut Vec<u8>, dice: &mut Dice<'_>) {
    let all = lines(b);
    let from = dice.below(all.len());
    let to = (from + dice.below(12)).min(all.len() - 1);
    b.drain(all[from].start..all[to].end);
}

/// One piece of damage to bytes.
pub(crate) fn bytes_once(b: &mut Vec<u8>, dice: &mut Dice<'_>) {
    if b.is_empty() {
        return;
    }
    let at = dice.below(b.len());
    match dice.below(6) {
        0 | 1 => b[at] ^= 1 << dice.below(8),
        2 => b.truncate(at),
        3 => {
            let to = (at + 1 + dice.below(1000)).min(b.len());
            b.drain(at..to);
        }
        4 => {
            let n = *dice.of(&[0_u64, 1, 1 << 31, 1 << 40, 1 << 60, u64::MAX, u64::MAX - 8]);
            let to = (at + 8).min(b.len());
            b[at..to].copy_from_slice(&n.to_le_bytes()[..to - at]);
        }
        _ => {
            let to = (at + dice.below(500)).min(b.len());
            let piece = b[at..to].to_vec();
            let there = dice.below(b.len());
            b.splice(there..there, piece);
        }
    }
}
