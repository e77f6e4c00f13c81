//! One decimal number in text, as the double nearest to its digits.

/// Powers of ten that a double holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];
/// Integers up to this are exact as doubles.
const EXACT: u64 = 1 << 53;
/// The first of them as integers.
const TENS: [u64; 8] = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000];

/// A decimal number and where it ends.
#[inline]
pub(super) fn number(text: &[u8], start: usize) -> Option<(f64, usize)> {
    match short(text, start) {
        Some(found) => Some(found),
        None => any(text, start),
    }
}

/// A number of at most seven digits before the point and seven after it, eight bytes at a time.
#[inline]
fn short(text: &[u8], start: usize) -> Option<(f64, usize)> {
    let sign = *text.get(start)?;
    let first = start + usize::from(matches!(sign, b'-' | b'+'));
    let (whole, n_whole) = leading_digits(word(text, first)?);
    let mut at = first + n_whole;
    if n_whole == 8 {
        return None;
    }
    let mut size = whole as f64;
    let mut n_digits = n_whole;
    if text[at] == b'.' {
        let (part, n_part) = leading_digits(word(text, at + 1)?);
        if n_part == 8 {
            return None;
        }
        // Fourteen digits are an integer that is exact as a double, and so is the power of ten: one rounding.
        let digits = whole * TENS[n_part] + part;
        size = digits as f64 / POWERS[n_part];
        at += 1 + n_part;
        n_digits += n_part;
    }
    if n_digits == 0 || matches!(text[at], b'e' | b'E') {
        return None;
    }
    Some((if sign == b'-' { -size } else { size }, at))
}

#[inline]
fn word(text: &[u8], at: usize) -> Option<u64> {
    text.get(at..at + 8)?
        .try_into()
        .ok()
        .map(u64::from_le_bytes)
}

/// The number formed by the first digits of eight bytes, and how many there are.
#[inline]
fn leading_digits(word: u64) -> (u64, usize) {
    let ones = word ^ 0x3030_3030_3030_3030;
    // A byte above nine sets its highest bit; its carry reaches only bytes after it.
    let others = (ones.wrapping_add(0x7676_7676_7676_7676) | ones) & 0x8080_8080_8080_8080;
    let n = others.trailing_zeros() as usize / 8;
    if n <= 1 {
        return (ones & 0xFF & 0xFF_u64.wrapping_mul(n as u64), n);
    }
    // The digits move to the end of the word, zeros in front of them.
    (of_eight(ones << (64 - 8 * n)), n)
}

/// Any decimal number.
fn any(text: &[u8], start: usize) -> Option<(f64, usize)> {
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
    // One rounding: an integer times or over a power of ten, both exact as doubles. 19 digits fit into 64 bits.
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
    Some(of_eight(word & 0x0F0F_0F0F_0F0F_0F0F))
}

/// Eight digits, one in each byte, as one number.
#[inline]
fn of_eight(ones: u64) -> u64 {
    let pairs = (ones.wrapping_mul(10).wrapping_add(ones >> 8)) & 0x00FF_00FF_00FF_00FF;
    let fours = (pairs.wrapping_mul(100).wrapping_add(pairs >> 16)) & 0x0000_FFFF_0000_FFFF;
    fours.wrapping_mul(10_000).wrapping_add(fours >> 32) & 0xFFFF_FFFF
}
