//! Vectorised loops and the branch-free functions that they need.

/// Defines a function that is compiled twice, for AVX2 and for any processor; the better version is chosen at run time.
///
/// It suits loops over groups of eight numbers. With AVX-512 the compiler joins two groups, and the shuffles cost more
/// than the arithmetic saves. Multiplications and additions are never fused, so both versions give the same bits.
#[macro_export]
macro_rules! widened_to_eight {
    ($(#[$doc:meta])* $visibility:vis fn $name:ident($($argument:ident: $kind:ty),* $(,)?) = $body:ident) => {
        $(#[$doc])*
        #[allow(clippy::too_many_arguments, reason = "those of the body")]
        $visibility fn $name($($argument: $kind),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                #[allow(clippy::too_many_arguments, reason = "those of the body")]
                fn with_avx2($($argument: $kind),*) {
                    $body($($argument),*);
                }
                if $crate::instructions::Instructions::widest() >= $crate::instructions::Instructions::Avx2 {
                    // SAFETY: the processor has AVX2.
                    return unsafe { with_avx2($($argument),*) };
                }
            }
            $body($($argument),*);
        }
    };
}
pub use widened_to_eight;

/// Defines a function like [`widened_to_eight`], with a third version for AVX-512.
#[macro_export]
macro_rules! widened {
    ($(#[$doc:meta])* $visibility:vis fn $name:ident($($argument:ident: $kind:ty),* $(,)?) = $body:ident) => {
        $(#[$doc])*
        #[allow(clippy::too_many_arguments, reason = "those of the body")]
        $visibility fn $name($($argument: $kind),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
                #[allow(clippy::too_many_arguments, reason = "those of the body")]
                fn with_avx512($($argument: $kind),*) {
                    $body($($argument),*);
                }
                if $crate::instructions::Instructions::widest() == $crate::instructions::Instructions::Avx512 {
                    // SAFETY: the processor has these parts of AVX-512.
                    return unsafe { with_avx512($($argument),*) };
                }
            }
            $crate::simd::widened_to_eight! { fn narrower($($argument: $kind),*) = $body }
            narrower($($argument),*);
        }
    };
}
pub use widened;

/// Asks the processor to load a value into its cache, if it can.
#[inline(always)]
pub fn prefetch<T: ?Sized>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        const LINE: usize = 64;
        let start = std::ptr::from_ref(value).cast::<i8>();
        for offset in (0..size_of_val(value)).step_by(LINE) {
            // SAFETY: the address lies within the value, and a prefetch changes nothing that the program can observe.
            unsafe { std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(start.add(offset)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}

/// Constant 1.5·2²³. Adding it to a number below 2²² in magnitude leaves the nearest integer in the lowest bits of the
/// sum.
pub const TO_INTEGER: f32 = 12_582_912.0;

/// The integer nearest to `x`, half to even, for `x` in 0..2²². The lowest 22 bits of the result are the integer;
/// higher bits are also set.
#[inline(always)]
pub fn nearest_bits(x: f32) -> u32 {
    (x + TO_INTEGER).to_bits()
}

/// Largest integer that is not above `x`, for |x| below 2²².
#[inline(always)]
pub fn floor(x: f32) -> i32 {
    let shifted = x + TO_INTEGER;
    let nearest = (shifted.to_bits() as i32).wrapping_sub(TO_INTEGER.to_bits() as i32);
    nearest.wrapping_sub(i32::from(shifted - TO_INTEGER > x))
}

/// Largest integer that is not above `x`, for |x| below 2²²: as a float and as the 32 bits of an integer. For an
/// integer `x`, the result may be `x` − 1.
#[inline(always)]
pub fn floored(x: f32) -> (f32, u32) {
    let shifted = (x - 0.5) + TO_INTEGER;
    (shifted - TO_INTEGER, shifted.to_bits().wrapping_sub(TO_INTEGER.to_bits()))
}

/// `x`, or `least` if that is larger, in one instruction; NaN is not handled.
#[inline(always)]
pub fn at_least(x: f32, least: f32) -> f32 {
    if x > least { x } else { least }
}

/// `x`, or `most` if that is smaller, in one instruction; NaN is not handled.
#[inline(always)]
pub fn at_most(x: f32, most: f32) -> f32 {
    if x < most { x } else { most }
}

/// Conversion of an integer below 2³¹ to a float.
#[inline(always)]
pub fn real(x: u32) -> f32 {
    x as i32 as f32
}

/// Hash of three words to three words: pcg3d (Jarzynski and Olano, "Hash functions for GPU rendering", JCGT 2020).
#[inline(always)]
pub fn pcg3d(key: [u32; 3]) -> [u32; 3] {
    let [mut x, mut y, mut z] = key.map(|v| v.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    (x, y, z) = (x ^ x >> 16, y ^ y >> 16, z ^ z >> 16);
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    [x, y, z]
}

/// log₂ of a normal positive number, with an error of 5·10⁻⁷ plus the rounding of the result.
///
/// The exponent is added to a minimax polynomial over √½..√2.
#[inline(always)]
pub fn log2(x: f32) -> f32 {
    const ROOT_HALF: u32 = 0x3f35_04f3;
    let bits = x.to_bits().wrapping_sub(ROOT_HALF);
    let exponent = (bits as i32) >> 23;
    let t = f32::from_bits((bits & 0x007f_ffff).wrapping_add(ROOT_HALF)) - 1.0;
    let p = LOG2[7];
    let p = p * t + LOG2[6];
    let p = p * t + LOG2[5];
    let p = p * t + LOG2[4];
    let p = p * t + LOG2[3];
    let p = p * t + LOG2[2];
    let p = p * t + LOG2[1];
    let p = p * t + LOG2[0];
    exponent as f32 + p * t
}

/// eˣ for −87 < x < 88, with a relative error of 3·10⁻⁷; e⁰ is exactly 1.
///
/// x is split into an integer times ln 2 and a remainder of at most ½·ln 2, for which there is a minimax polynomial.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    // ln 2 is the sum of two parts; the first has so few bits that its multiples are exact.
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let shifted = x * std::f32::consts::LOG2_E + TO_INTEGER;
    let whole = shifted - TO_INTEGER;
    let t = x - whole * LN_2_HIGH - whole * LN_2_LOW;
    let p = EXP[6];
    let p = p * t + EXP[5];
    let p = p * t + EXP[4];
    let p = p * t + EXP[3];
    let p = p * t + EXP[2];
    let p = p * t + EXP[1];
    let p = p * t + EXP[0];
    // The integer is in the lowest bits of `shifted`; the shift moves it to the exponent.
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// e^(i2π·turns) as [re, im], for fewer than 2²¹ turns, with an error of 2·10⁻⁷. The shaders have the same function in
/// `crates/render/shaders/shared/phasor.wgsl`.
#[inline(always)]
#[allow(clippy::approx_constant, reason = "a fitted coefficient, not 2π")]
pub fn phasor(turns: f32) -> [f32; 2] {
    let shifted = 2.0 * turns + TO_INTEGER;
    let r = turns - 0.5 * (shifted - TO_INTEGER);
    let u = r * r;
    let c = 0.999_999_94 + u * (-19.739_172 + u * (64.934_59 + u * (-85.240_326 + u * 56.242_363)));
    let s = r * (6.283_185 + u * (-41.341_656 + u * (81.601_006 + u * (-76.549_78 + u * 39.536_697))));
    // An odd number of half turns changes the sign.
    let sign = shifted.to_bits() << 31;
    [f32::from_bits(c.to_bits() ^ sign), f32::from_bits(s.to_bits() ^ sign)]
}

const LOG2: [f32; 8] =
    [1.442_694_8, -0.721_357_1, 0.480_939_4, -0.360_088_1, 0.286_708_6, -0.250_061_48, 0.236_882_16, -0.145_756_24];
const EXP: [f32; 7] = [1.0, 1.0, 0.499_999_9, 0.166_664_2, 0.041_668_225, 0.008_374_825, 0.001_383_683_2];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log2_and_exp_are_as_close_as_they_say() {
        assert_eq!(exp(0.0), 1.0);
        for i in 0..2_000_000u32 {
            let x = f32::from_bits(0x0080_0000 + 1061 * i);
            let exact = f64::from(x).log2();
            assert!((f64::from(log2(x)) - exact).abs() < 5.0e-7 + exact.abs() / 16_777_216.0, "log2 {x:e}");
            let y = -87.0 + 175.0 * i as f32 / 2_000_000.0;
            let exact = f64::from(y).exp();
            assert!((f64::from(exp(y)) / exact - 1.0).abs() < 3.0e-7, "exp {y}");
        }
    }

    #[test]
    fn phasors_are_on_the_circle() {
        for i in -200_000..200_000 {
            let turns = i as f32 * 0.007_31;
            let [c, s] = phasor(turns);
            let (sin, cos) = (std::f64::consts::TAU * f64::from(turns).fract()).sin_cos();
            assert!((f64::from(c) - cos).abs() < 3.0e-7 && (f64::from(s) - sin).abs() < 3.0e-7, "{turns}");
        }
    }

    #[test]
    fn integers_are_those_of_the_standard_library() {
        for i in -400_000..400_000 {
            let x = i as f32 * 0.0371;
            assert_eq!(floor(x), x.floor() as i32, "{x}");
            let (number, bits) = floored(x);
            assert!(number == x.floor() || number + 1.0 == x, "{x}");
            assert_eq!(number, bits as i32 as f32);
        }
    }
}
