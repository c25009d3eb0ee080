//! Messages of the renderer: words behind a checksum, which lies have too.

/// Changes the words of a message by `lie`, and makes its checksum right again. What is no such
/// message stays as it is.
pub(crate) fn change_words(message: &mut Vec<u8>, lie: impl FnOnce(&mut Vec<u32>)) {
    let Some((head, body)) = message.split_first_chunk::<8>() else { return };
    // A message whose checksum is computed in another way would be refused for that.
    assert_eq!(u64::from_le_bytes(*head), checksum(body), "the checksum of messages of words");
    let words = body.as_chunks::<4>().0.iter().map(|c| u32::from_le_bytes(*c));
    let mut words: Vec<u32> = words.collect();
    lie(&mut words);
    let body: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
    *message = [&checksum(&body).to_le_bytes()[..], &body].concat();
}

/// The checksum in front of a message: eight chains over blocks of 64 bytes, then the rest.
fn checksum(bytes: &[u8]) -> u64 {
    let mix = |state: u64, value: u64| {
        (state ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
    };
    let (blocks, rest) = bytes.as_chunks::<64>();
    let mut chains: [u64; 8] = std::array::from_fn(|i| i as u64);
    for block in blocks {
        for (chain, word) in chains.iter_mut().zip(block.as_chunks::<8>().0) {
            *chain = mix(*chain, u64::from_le_bytes(*word));
        }
    }
    let state = chains.into_iter().fold(bytes.len() as u64, mix);
    rest.chunks(8).fold(state, |state, chunk| {
        let mut whole = [0; 8];
        whole[..chunk.len()].copy_from_slice(chunk);
        mix(state, u64::from_le_bytes(whole))
    })
}
