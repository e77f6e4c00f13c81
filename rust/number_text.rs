//! Plain tables of numbers in text, parsed by all threads: one separator, one number in every field, one row a line.
//!
//! Anything else (a quote, a word, a remark, a missing cell, an odd line) makes the block no plain table, and whoever
//! asked reads it with more patience.

use rayon::prelude::*;

/// Bytes a thread takes at a time.
const SHARE: usize = 1 << 20;
/// Powers of ten that a double holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];
/// Whole numbers up to this are doubles exactly.
const EXACT: u64 = 1 << 53;

/// The columns of a plain table one after the other, `n_columns` times as many numbers as rows; `None` for any other text.
///
/// Every number is the double nearest to its decimal digits. Blanks round fields are passed over; lines end with `\n` or
/// `\r\n`, the last one also with the text.
#[must_use]
pub fn plain_table(text: &[u8], separator: u8, n_columns: usize) -> Option<Vec<f64>> {
    let shares = shares(text);
    let rows: Vec<usize> = shares.par_iter().map(|share| lines(share)).collect();
    let n: usize = rows.iter().sum();
    let mut out = vec![0.0; n * n_columns];
    // Each share writes its rows into every column: the columns are cut where the shares are.
    let mut columns: Vec<&mut [f64]> = out.chunks_mut(n.max(1)).collect();
    let mut parts: Vec<Vec<&mut [f64]>> = Vec::with_capacity(shares.len());
    for &rows in &rows {
        let mut part = Vec::with_capacity(n_columns);
        for column in &mut columns {
            let (here, rest) = std::mem::take(column).split_at_mut(rows);
            part.push(here);
            *column = rest;
        }
        parts.push(part);
    }
    let is_plain = shares
        .par_iter()
        .zip(parts)
        .all(|(share, mut part)| parse(share, separator, &mut part).is_some());
    is_plain.then_some(out)
}

/// Pieces that end with a line.
fn shares(text: &[u8]) -> Vec<&[u8]> {
    let mut out = Vec::with_capacity(text.len() / SHARE + 1);
    let mut rest = text;
    while !rest.is_empty() {
        let at = SHARE.min(rest.len());
        let stop = rest[at..]
            .iter()
            .position(|&b| b == b'\n')
            .map_or(rest.len(), |more| at + more + 1);
        let (share, after) = rest.split_at(stop);
        out.push(share);
        rest = after;
    }
    out
}

fn lines(share: &[u8]) -> usize {
    // In pieces of 255, whose count fits into a byte: the compiler counts them side by side.
    let ends: usize = share
        .chunks(255)
        .map(|piece| usize::from(piece.iter().map(|&b| u8::from(b == b'\n')).sum::<u8>()))
        .sum();
    ends + usize::from(share.last().is_some_and(|&b| b != b'\n'))
}

fn parse(text: &[u8], separator: u8, columns: &mut [&mut [f64]]) -> Option<()> {
    let n = columns.len();
    let rows = columns.first().map_or(0, |column| column.len());
    let mut at = 0;
    for row in 0..rows {
        for (k, column) in columns.iter_mut().enumerate() {
            at = skip_blanks(text, at, separator);
            let (value, next) = number(text, at)?;
            column[row] = value;
            at = next;
            if k + 1 < n {
                if separator != b' ' {
                    at = skip_blanks(text, at, separator);
                }
                let is_end = if separator == b' ' {
                    !matches!(text.get(at), Some(b' ' | b'\t'))
                } else {
                    text.get(at) != Some(&separator)
                };
                if is_end {
                    return None;
                }
                at += 1;
            }
        }
        at = skip_blanks(text, at, separator);
        if text.get(at) == Some(&b'\r') {
            at += 1;
        }
        match text.get(at) {
            Some(b'\n') => at += 1,
            None => {}
            Some(_) => return None,
        }
    }
    (at == text.len()).then_some(())
}

fn skip_blanks(text: &[u8], mut at: usize, separator: u8) -> usize {
    while let Some(&b) = text.get(at)
        && (b == b' ' || (b == b'\t' && separator != b'\t'))
    {
        at += 1;
    }
    at
}

/// A decimal number and where it ends.
fn number(text: &[u8], start: usize) -> Option<(f64, usize)> {
    let is_negative = text.get(start) == Some(&b'-');
    let mut at = start + usize::from(matches!(text.get(start), Some(b'-' | b'+')));
    let first = at;
    let mut digits = 0_u64;
    while let Some(d) = digit(text, at) {
        digits = digits.wrapping_mul(10).wrapping_add(d);
        at += 1;
    }
    let mut n_digits = at - first;
    let mut power = 0_i64;
    if text.get(at) == Some(&b'.') {
        at += 1;
        let first = at;
        while let Some(eight) = eight_digits(text, at) {
            digits = digits.wrapping_mul(100_000_000).wrapping_add(eight);
            at += 8;
        }
        while let Some(d) = digit(text, at) {
            digits = digits.wrapping_mul(10).wrapping_add(d);
            at += 1;
        }
        n_digits += at - first;
        power = -i64::try_from(at - first).ok()?;
    }
    if n_digits == 0 {
        return None;
    }
    if matches!(text.get(at), Some(b'e' | b'E')) {
        let (exponent, next) = exponent(text, at + 1)?;
        power += exponent;
        at = next;
    }
    // One rounding: a whole number a double holds, times or over a power of ten a double holds. 19 digits fit into 64 bits.
    let scale = usize::try_from(power.unsigned_abs())
        .ok()
        .and_then(|p| POWERS.get(p));
    let size = match scale {
        Some(scale) if n_digits <= 19 && digits <= EXACT => {
            if power < 0 {
                digits as f64 / scale
            } else {
                digits as f64 * scale
            }
        }
        _ => std::str::from_utf8(&text[first..at]).ok()?.parse().ok()?,
    };
    Some((if is_negative { -size } else { size }, at))
}

fn exponent(text: &[u8], mut at: usize) -> Option<(i64, usize)> {
    let is_negative = text.get(at) == Some(&b'-');
    if matches!(text.get(at), Some(b'-' | b'+')) {
        at += 1;
    }
    let first = at;
    let mut value = 0_i64;
    while let Some(d) = digit(text, at) {
        value = (value * 10 + i64::try_from(d).ok()?).min(1_000_000);
        at += 1;
    }
    (at > first).then_some((if is_negative { -value } else { value }, at))
}

fn digit(text: &[u8], at: usize) -> Option<u64> {
    let d = text.get(at)?.wrapping_sub(b'0');
    (d < 10).then_some(u64::from(d))
}

/// Eight digits at once, as three multiplications of neighbours.
fn eight_digits(text: &[u8], at: usize) -> Option<u64> {
    let bytes: [u8; 8] = text.get(at..at + 8)?.try_into().ok()?;
    let word = u64::from_le_bytes(bytes);
    let high = word & 0xF0F0_F0F0_F0F0_F0F0;
    let carried = word.wrapping_add(0x0606_0606_0606_0606) & 0xF0F0_F0F0_F0F0_F0F0;
    if high != 0x3030_3030_3030_3030 || carried != high {
        return None;
    }
    let ones = word & 0x0F0F_0F0F_0F0F_0F0F;
    let pairs = (ones.wrapping_mul(10).wrapping_add(ones >> 8)) & 0x00FF_00FF_00FF_00FF;
    let fours = (pairs.wrapping_mul(100).wrapping_add(pairs >> 16)) & 0x0000_FFFF_0000_FFFF;
    Some((fours.wrapping_mul(10_000).wrapping_add(fours >> 32)) & 0xFFFF_FFFF)
}
