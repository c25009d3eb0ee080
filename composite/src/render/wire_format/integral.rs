//! What a ray has collected in the bricks of volumes so far.
use rt_core::volume::PartialIntegral;

/// Words of a [`PartialIntegral`].
pub(in crate::render) const INTEGRAL_WORDS: usize = 11;

/// The words of what a ray has collected: five f64 of two words each, then the samples.
pub(in crate::render) fn encode_integral(collected: &PartialIntegral) -> [u32; INTEGRAL_WORDS] {
    let [r, g, b] = collected.color;
    let numbers = [r, g, b, collected.transmittance, collected.depth];
    let mut words = [0; INTEGRAL_WORDS];
    for (pair, number) in words.chunks_exact_mut(2).zip(numbers) {
        let bits = number.to_bits();
        pair.copy_from_slice(&[bits as u32, (bits >> 32) as u32]);
    }
    words[10] = collected.samples;
    words
}

/// Decodes the words of [`encode_integral`].
pub(in crate::render) fn decode_integral(words: &[u32; INTEGRAL_WORDS]) -> PartialIntegral {
    let number =
        |i: usize| f64::from_bits(u64::from(words[2 * i]) | u64::from(words[2 * i + 1]) << 32);
    PartialIntegral {
        color: [0, 1, 2].map(number),
        transmittance: number(3),
        depth: number(4),
        samples: words[10],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rays_collect_survives_with_all_its_bits() {
        let some = PartialIntegral {
            color: [0.1, -0.0, f64::MIN_POSITIVE],
            transmittance: 1.0 / 3.0,
            depth: 1e300,
            samples: u32::MAX,
        };
        for collected in [PartialIntegral::default(), some] {
            let words = encode_integral(&collected);
            assert_eq!(decode_integral(&words), collected);
            assert_eq!(encode_integral(&decode_integral(&words)), words, "the sign of zero, too");
        }
    }
}
