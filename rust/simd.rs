//! Loops compiled once per instruction set and chosen when they are called.
//!
//! A kernel is an ordinary function over short arrays of lanes whose inner loops run over the lanes; the compiler turns
//! them into vectors as long as the instruction set has. `FUSED` says whether a multiply-add is one instruction there:
//! without it `f64::mul_add` would be a call. Results of the sets differ by rounding only.

use std::sync::OnceLock;

/// An instruction set that this processor was found to offer: only [`Instructions::offered`] makes one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Instructions(pub(crate) Set);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Set {
    /// 512-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// 256-bit vectors with fused multiply-add.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// The baseline of the target (on aarch64 128-bit vectors with fused multiply-add).
    Portable,
}

/// Whether the baseline of this target multiplies and adds in one instruction.
pub(crate) const FUSED_BASELINE: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

impl Instructions {
    /// The widest that this processor has, or the one that `TRIHEDRON_INSTRUCTIONS` names (`avx512`, `avx2`,
    /// `portable`) where this processor has it.
    #[must_use]
    pub fn detect() -> Self {
        static CHOSEN: OnceLock<Instructions> = OnceLock::new();
        *CHOSEN.get_or_init(|| {
            let wanted = std::env::var("TRIHEDRON_INSTRUCTIONS").unwrap_or_default();
            let offered = Self::offered();
            *offered
                .iter()
                .find(|set| set.name() == wanted)
                .unwrap_or(&offered[0])
        })
    }

    /// Its name in `TRIHEDRON_INSTRUCTIONS`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => "avx512",
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => "avx2",
            Set::Portable => "portable",
        }
    }

    /// Every set that this processor has, widest first.
    #[must_use]
    pub fn offered() -> &'static [Self] {
        #[cfg(target_arch = "x86_64")]
        {
            let avx2 = std::arch::is_x86_feature_detected!("avx2")
                && std::arch::is_x86_feature_detected!("fma");
            if avx2
                && std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512dq")
                && std::arch::is_x86_feature_detected!("avx512vl")
            {
                return &[Self(Set::Avx512), Self(Set::Avx2), Self(Set::Portable)];
            }
            if avx2 {
                return &[Self(Set::Avx2), Self(Set::Portable)];
            }
        }
        &[Self(Set::Portable)]
    }
}

/// `a b + c`, in one instruction where the instruction set has one.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "a function that is not inlined keeps the features of the baseline"
)]
pub(crate) fn fma<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// `name(instructions, arguments)` from a body `fn body<const FUSED: bool>(arguments)` that is always inlined.
macro_rules! for_each_instruction_set {
    ($(#[$meta:meta])* $vis:vis fn $name:ident($($arg:ident: $kind:ty),* $(,)?) $(-> $out:ty)? = $body:ident) => {
        $(#[$meta])*
        $vis fn $name(instructions: $crate::simd::Instructions, $($arg: $kind),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
                fn avx512($($arg: $kind),*) $(-> $out)? {
                    $body::<true>($($arg),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($arg: $kind),*) $(-> $out)? {
                    $body::<true>($($arg),*)
                }
                match instructions.0 {
                    // SAFETY: `Instructions::offered` saw these instructions on this processor.
                    $crate::simd::Set::Avx512 => return unsafe { avx512($($arg),*) },
                    // SAFETY: as above.
                    $crate::simd::Set::Avx2 => return unsafe { avx2($($arg),*) },
                    $crate::simd::Set::Portable => {}
                }
            }
            let _ = instructions;
            $body::<{ $crate::simd::FUSED_BASELINE }>($($arg),*)
        }
    };
}
pub(crate) use for_each_instruction_set;
