//! The serial reference: all frames on one node, one pixel after the other. Every strategy gives
//! these bits.
use crate::error::CompositeError;
use crate::frame::{Frame, Image};
use crate::pixel::Composite;
use crate::rank_order::reduce_ranks;

/// Composites `frames`, in rank order, in the canonical grouping of [`crate::rank_order`].
///
/// # Errors
/// [`CompositeError::NoFrames`] for an empty slice, [`CompositeError::SizesDiffer`] if the frames
/// are not all of one size.
pub fn composite_serial<P: Composite>(frames: &[Frame<'_, P>]) -> Result<Image<P>, CompositeError> {
    let (width_px, height_px) = check_sizes(frames)?;
    let first = &frames[0];
    let mut column = vec![P::EMPTY; frames.len()];
    let (mut colors, mut depths) = (Vec::with_capacity(first.len()), Vec::new());
    for index in 0..first.len() {
        for (pixel, frame) in column.iter_mut().zip(frames) {
            *pixel = frame.pixel(index);
        }
        let pixel = reduce_ranks(&mut column);
        colors.push(pixel.color());
        if P::HAS_DEPTH {
            depths.push(pixel.depth());
        }
    }
    Ok(Image { width_px, height_px, colors, depths })
}

/// Checks that all frames have one size, and returns it.
pub(crate) fn check_sizes<P: Composite>(
    frames: &[Frame<'_, P>],
) -> Result<(u32, u32), CompositeError> {
    let first = frames.first().ok_or(CompositeError::NoFrames)?;
    let (width_px, height_px) = (first.width_px(), first.height_px());
    for (rank, frame) in frames.iter().enumerate() {
        if (frame.width_px(), frame.height_px()) != (width_px, height_px) {
            return Err(CompositeError::SizesDiffer {
                rank,
                found_px: (frame.width_px(), frame.height_px()),
                expected_px: (width_px, height_px),
            });
        }
    }
    Ok((width_px, height_px))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pixel::DepthPixel;

    #[test]
    fn frames_of_different_sizes_are_refused_by_rank() {
        let color = [[0_u8; 4]; 6];
        let a = Frame::premultiplied(3, 2, &color).unwrap();
        let b = Frame::premultiplied(2, 3, &color).unwrap();
        let error = composite_serial(&[a, a, b]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "rank 2 has a 2x3 image, the others 3x2: render the same size on every rank"
        );
        assert!(matches!(
            composite_serial::<DepthPixel<[u8; 4]>>(&[]),
            Err(CompositeError::NoFrames)
        ));
    }

    #[test]
    fn faint_layers_add_up_instead_of_vanishing() {
        // 128 layers of alpha 0.005: exact coverage 1 - 0.995^128.
        let alpha = 0.005_f32;
        let layer = [[alpha; 4]];
        let frames = vec![Frame::premultiplied(1, 1, &layer).unwrap(); 128];
        let image = composite_serial(&frames).unwrap();
        let exact = 1.0 - (1.0 - f64::from(alpha)).powi(128);
        assert!(
            (f64::from(image.colors()[0][3]) - exact).abs() < 2e-6,
            "{:?} against {exact}",
            image.colors()[0]
        );
    }
}
