//! OpenEXR files of pictures.

use exr::meta::attribute::AttributeValue;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text,
    WritableImage,
};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::io::Cursor;

/// Name, unit and numbers of a channel: float32 or uint32, row by row.
type Channel<'py> = (String, String, Bound<'py, PyAny>);

/// The bytes of an OpenEXR file of one part, without loss. The unit of channel `depth.Z` is the
/// text attribute `unit.depth.Z`, as in the files of the programs.
#[pyfunction]
pub(crate) fn exr_bytes<'py>(
    py: Python<'py>,
    size: (usize, usize),
    channels: Vec<Channel<'py>>,
    software: &str,
) -> PyResult<Bound<'py, PyBytes>> {
    let mut attributes =
        LayerAttributes { software_name: Some(Text::from(software)), ..Default::default() };
    let mut list = Vec::with_capacity(channels.len());
    for (name, unit, values) in channels {
        let samples = match values.cast::<PyArray1<u32>>() {
            Ok(ids) => FlatSamples::U32(ids.try_readonly()?.as_slice()?.to_vec()),
            Err(_) => {
                let values = values.cast::<PyArray1<f32>>()?;
                FlatSamples::F32(values.try_readonly()?.as_slice()?.to_vec())
            }
        };
        if samples.len() != size.0 * size.1 {
            let (width, height) = size;
            let found = samples.len();
            return Err(PyValueError::new_err(format!(
                "channel {name} has {found} numbers for {width} x {height} pixels"
            )));
        }
        attributes.other.insert(
            Text::from(format!("unit.{name}").as_str()),
            AttributeValue::Text(Text::from(unit.as_str())),
        );
        list.push(AnyChannel::new(name.as_str(), samples));
    }
    let encoded = py.detach(|| {
        let channels = AnyChannels::sort(list.into());
        let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, channels);
        let mut bytes = Cursor::new(Vec::new());
        // exr's own threads would not survive a fork.
        let image = Image::from_layer(layer);
        image.write().non_parallel().to_buffered(&mut bytes).map(|()| bytes.into_inner())
    });
    let bytes = encoded.map_err(|e| PyValueError::new_err(format!("OpenEXR: {e}")))?;
    Ok(PyBytes::new(py, &bytes))
}
