//! Plain tables of numbers in text, parsed by all threads: one separator, one number in every field, one row a line.
//!
//! Any other content (a quote, a word, a comment, a missing cell, an irregular line) makes the text no plain table; the
//! caller then uses a slower and more general parser.

mod number;

use rayon::prelude::*;

use number::number;

/// Bytes a thread takes at a time.
const SHARE: usize = 1 << 20;
/// Memory for some columns: rows of `width` numbers, one after the other.
#[derive(Debug)]
pub struct Block<'a> {
    /// Whole rows.
    pub rows: &'a mut [f64],
    /// Numbers in a row.
    pub width: usize,
}

/// Result of parsing a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// Lines of the text.
    pub rows: usize,
    /// Whether every line was a row of the table, and every number is in its place.
    pub is_read: bool,
}

/// Write a plain table to its place: column `i` becomes number `places[i].1` of the rows of block `places[i].0`.
///
/// Every number is the double nearest to its decimal digits. Blanks around fields are skipped; lines end with `\n` or
/// `\r\n`, the last one also with the text. Where the text is anything else, or the blocks have too few rows, their
/// content afterwards is undefined.
#[must_use]
pub fn plain_table(
    text: &[u8],
    separator: u8,
    places: &[(usize, usize)],
    blocks: Vec<Block<'_>>,
) -> Outcome {
    let shares = shares(text);
    let counts: Vec<usize> = shares.par_iter().map(|share| lines(share)).collect();
    let rows: usize = counts.iter().sum();
    let no = Outcome {
        rows,
        is_read: false,
    };
    let fits = |block: &Block<'_>| block.width > 0 && block.rows.len() / block.width >= rows;
    if places.is_empty() || !blocks.iter().all(fits) {
        return no;
    }
    if !places
        .iter()
        .all(|&(block, k)| blocks.get(block).is_some_and(|b| k < b.width))
    {
        return no;
    }
    // Each share writes its rows into every block: the blocks are cut where the shares are.
    let mut rest = blocks;
    let mut parts = Vec::with_capacity(shares.len());
    for &count in &counts {
        let mut part = Vec::with_capacity(rest.len());
        for block in &mut rest {
            let (here, behind) = std::mem::take(&mut block.rows).split_at_mut(count * block.width);
            part.push(Block {
                rows: here,
                width: block.width,
            });
            block.rows = behind;
        }
        parts.push((count, part));
    }
    let is_read = shares
        .par_iter()
        .zip(parts)
        .all(|(share, (count, mut part))| {
            parse(share, separator, count, places, &mut part).is_some()
        });
    Outcome { rows, is_read }
}

/// Pieces of the text, each of whole lines.
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
    // Pieces of 255 bytes, whose count fits into a byte: the compiler vectorises it.
    let ends: usize = share
        .chunks(255)
        .map(|piece| usize::from(piece.iter().map(|&b| u8::from(b == b'\n')).sum::<u8>()))
        .sum();
    ends + usize::from(share.last().is_some_and(|&b| b != b'\n'))
}

fn parse(
    text: &[u8],
    separator: u8,
    rows: usize,
    places: &[(usize, usize)],
    blocks: &mut [Block<'_>],
) -> Option<()> {
    let last = places.len() - 1;
    let mut at = 0;
    for row in 0..rows {
        for (i, &(block, k)) in places.iter().enumerate() {
            at = skip_blanks(text, at, separator);
            let (value, next) = number(text, at)?;
            let block = &mut blocks[block];
            block.rows[row * block.width + k] = value;
            at = next;
            if i < last {
                at = behind_separator(text, at, separator)?;
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

#[inline]
fn behind_separator(text: &[u8], mut at: usize, separator: u8) -> Option<usize> {
    let is_end = if separator == b' ' {
        !matches!(text.get(at), Some(b' ' | b'\t'))
    } else {
        if text.get(at) != Some(&separator) {
            at = skip_blanks(text, at, separator);
        }
        text.get(at) != Some(&separator)
    };
    (!is_end).then_some(at + 1)
}

#[inline]
fn skip_blanks(text: &[u8], mut at: usize, separator: u8) -> usize {
    while let Some(&b) = text.get(at)
        && (b == b' ' || (b == b'\t' && separator != b'\t'))
    {
        at += 1;
    }
    at
}
