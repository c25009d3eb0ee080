//! ANARI's data types: their numbers (fixed by the specification, version 1.0, section "Data
//! types"), sizes and names, and the conversion of elements to numbers.

use rt_core::colormap::srgb_to_linear;

/// A number of the enumeration `ANARIDataType`. A program may pass any number; unknown ones have
/// size `None`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DataType(pub u32);

macro_rules! data_types {
    ($($name:ident = $value:literal;)*) => {
        #[allow(missing_docs, reason = "the names are the specification's")]
        impl DataType { $(pub const $name: DataType = DataType($value);)* }
        const NAMED: &[(DataType, &str)] = &[$((DataType::$name, stringify!($name)),)*];
    };
}

data_types! {
    UNKNOWN = 0; DATA_TYPE = 100; STRING = 101; VOID_POINTER = 102; BOOL = 103;
    STRING_LIST = 150; DATA_TYPE_LIST = 151; PARAMETER_LIST = 152;
    FUNCTION_POINTER = 200; MEMORY_DELETER = 201; STATUS_CALLBACK = 202;
    FRAME_COMPLETION_CALLBACK = 203;
    LIBRARY = 500; DEVICE = 501; OBJECT = 502; ARRAY = 503; ARRAY1D = 504; ARRAY2D = 505;
    ARRAY3D = 506;
    CAMERA = 507; FRAME = 508; GEOMETRY = 509; GROUP = 510; INSTANCE = 511; LIGHT = 512;
    MATERIAL = 513;
    RENDERER = 514; SURFACE = 515; SAMPLER = 516; SPATIAL_FIELD = 517; VOLUME = 518; WORLD = 519;
    INT8 = 1000; UINT8 = 1004; INT16 = 1008; UINT16 = 1012; INT32 = 1016; INT32_VEC2 = 1017;
    UINT32 = 1020; UINT32_VEC2 = 1021; UINT32_VEC3 = 1022; UINT32_VEC4 = 1023;
    INT64 = 1024; UINT64 = 1028; UINT64_VEC2 = 1029; UINT64_VEC3 = 1030; UINT64_VEC4 = 1031;
    FIXED8 = 1032; UFIXED8 = 1036; UFIXED8_VEC2 = 1037; UFIXED8_VEC3 = 1038; UFIXED8_VEC4 = 1039;
    FIXED16 = 1040; FIXED16_VEC3 = 1042; FIXED16_VEC4 = 1043;
    UFIXED16 = 1044; UFIXED16_VEC2 = 1045; UFIXED16_VEC3 = 1046; UFIXED16_VEC4 = 1047;
    FIXED32 = 1048; UFIXED32 = 1052; UFIXED32_VEC2 = 1053; UFIXED32_VEC3 = 1054;
    UFIXED32_VEC4 = 1055;
    FIXED64 = 1056; UFIXED64 = 1060; FLOAT16 = 1064;
    FLOAT32 = 1068; FLOAT32_VEC2 = 1069; FLOAT32_VEC3 = 1070; FLOAT32_VEC4 = 1071; FLOAT64 = 1072;
    FLOAT64_VEC4 = 1075;
    UFIXED8_R_SRGB = 2000; UFIXED8_RA_SRGB = 2001; UFIXED8_RGB_SRGB = 2002;
    UFIXED8_RGBA_SRGB = 2003;
    INT32_BOX1 = 2004; INT32_BOX4 = 2007; FLOAT32_BOX1 = 2008; FLOAT32_BOX2 = 2009;
    FLOAT32_BOX3 = 2010; FLOAT32_BOX4 = 2011;
    FLOAT32_MAT2 = 2012; FLOAT32_MAT3 = 2013; FLOAT32_MAT4 = 2014; FLOAT32_MAT2X3 = 2015;
    FLOAT32_MAT3X4 = 2016;
    FLOAT32_QUAT_IJKW = 2017; UINT64_REGION1 = 2104; UINT64_REGION4 = 2107; FLOAT64_BOX1 = 2208;
    FLOAT64_BOX4 = 2211;
}

/// Families of vector types, each with one to four components: the number of the first type, bytes
/// per component, name.
const FAMILIES: &[(u32, usize, &str)] = &[
    (1000, 1, "INT8"),
    (1004, 1, "UINT8"),
    (1008, 2, "INT16"),
    (1012, 2, "UINT16"),
    (1016, 4, "INT32"),
    (1020, 4, "UINT32"),
    (1024, 8, "INT64"),
    (1028, 8, "UINT64"),
    (1032, 1, "FIXED8"),
    (1036, 1, "UFIXED8"),
    (1040, 2, "FIXED16"),
    (1044, 2, "UFIXED16"),
    (1048, 4, "FIXED32"),
    (1052, 4, "UFIXED32"),
    (1056, 8, "FIXED64"),
    (1060, 8, "UFIXED64"),
    (1064, 2, "FLOAT16"),
    (1068, 4, "FLOAT32"),
    (1072, 8, "FLOAT64"),
];

/// Number format of one component.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Component {
    Signed(usize),
    Unsigned(usize),
    FixedSigned(usize),
    Fixed(usize),
    Srgb,
    Half,
    Single,
    Double,
}

impl DataType {
    fn family(self) -> Option<(usize, usize, &'static str)> {
        let &(first, bytes, name) =
            FAMILIES.iter().find(|(first, ..)| (*first..first + 4).contains(&self.0))?;
        Some((bytes, (self.0 - first) as usize + 1, name))
    }

    /// Bytes of one element; `None` for types without values (strings, lists, unknown numbers).
    pub fn size(self) -> Option<usize> {
        if let Some((bytes, components, _)) = self.family() {
            return Some(bytes * components);
        }
        Some(match self.0 {
            100 | 103 => 4,
            102 | 200..=203 | 500..=519 => 8,
            2000..=2003 => (self.0 - 1999) as usize,
            2004..=2007 => 8 * (self.0 - 2003) as usize,
            2008..=2011 => 8 * (self.0 - 2007) as usize,
            2012 => 16,
            2013 => 36,
            2014 => 64,
            2015 => 24,
            2016 => 48,
            2017 => 16,
            2104..=2107 => 16 * (self.0 - 2103) as usize,
            2208..=2211 => 16 * (self.0 - 2207) as usize,
            _ => return None,
        })
    }

    /// The name without the prefix `ANARI_`.
    pub fn name(self) -> String {
        if let Some((_, components, name)) = self.family() {
            return if components == 1 {
                name.to_owned()
            } else {
                format!("{name}_VEC{components}")
            };
        }
        NAMED
            .iter()
            .find(|(t, _)| *t == self)
            .map_or(format!("type number {}", self.0), |(_, n)| (*n).to_owned())
    }

    /// True for handles of objects.
    pub fn is_object(self) -> bool {
        (502..=519).contains(&self.0)
    }

    /// True for the three kinds of arrays and for the type that covers all three.
    pub fn is_array(self) -> bool {
        (503..=506).contains(&self.0)
    }

    /// Whether a parameter of type `self` accepts an object of type `given`.
    pub fn accepts(self, given: DataType) -> bool {
        self == given
            || (self == DataType::OBJECT && given.is_object())
            || (given == DataType::OBJECT && self.is_object())
            || (given == DataType::ARRAY && self.is_array())
            || (self == DataType::ARRAY && given.is_array())
    }

    fn component(self) -> Option<(Component, usize)> {
        if (2000..=2003).contains(&self.0) {
            return Some((Component::Srgb, (self.0 - 1999) as usize));
        }
        let (bytes, components, name) = self.family()?;
        let kind = match name {
            "FLOAT16" => Component::Half,
            "FLOAT32" => Component::Single,
            "FLOAT64" => Component::Double,
            n if n.starts_with("UFIXED") => Component::Fixed(bytes),
            n if n.starts_with("FIXED") => Component::FixedSigned(bytes),
            n if n.starts_with('U') => Component::Unsigned(bytes),
            _ => Component::Signed(bytes),
        };
        Some((kind, components))
    }

    /// The number of components; 0 for types that are not vectors.
    pub fn components(self) -> usize {
        self.component().map_or(0, |(_, n)| n)
    }

    /// True for types whose elements [`DataType::attribute`] can convert to colours: all except
    /// integers.
    pub fn is_color(self) -> bool {
        self.component()
            .is_some_and(|(c, _)| !matches!(c, Component::Signed(_) | Component::Unsigned(_)))
    }

    /// One element as an attribute value. Missing components come from (0, 0, 0, 1). Fixed-point
    /// numbers are scaled to 0..=1 (signed: -1..=1). sRGB is decoded, except for alpha, the last of
    /// two or four components, which is linear.
    pub fn attribute(self, bytes: &[u8]) -> [f32; 4] {
        let mut out = [0.0, 0.0, 0.0, 1.0];
        let Some((kind, n)) = self.component() else { return out };
        let size = bytes.len() / n;
        for c in 0..n {
            let b = &bytes[c * size..(c + 1) * size];
            out[c] = match kind {
                Component::Single => f32::from_ne_bytes([b[0], b[1], b[2], b[3]]),
                Component::Double => float64(b) as f32,
                Component::Half => half(u16::from_ne_bytes([b[0], b[1]])),
                Component::Srgb if c == n - 1 && n % 2 == 0 => f32::from(b[0]) / 255.0,
                Component::Srgb => srgb_to_linear(f32::from(b[0]) / 255.0),
                Component::Fixed(s) => (unsigned(b) as f64 / unsigned_max(s)) as f32,
                Component::FixedSigned(s) => {
                    (signed(b) as f64 / (unsigned_max(s) / 2.0).floor()).max(-1.0) as f32
                }
                Component::Unsigned(_) => unsigned(b) as f32,
                Component::Signed(_) => signed(b) as f32,
            };
        }
        out
    }

    /// The components of one element as f64, without padding.
    pub fn numbers(self, bytes: &[u8]) -> Vec<f64> {
        let scalars = |size: usize, f: fn(&[u8]) -> f64| bytes.chunks_exact(size).map(f).collect();
        match self.component() {
            Some((Component::Double, _)) => scalars(8, float64),
            Some((Component::Unsigned(s), _)) => scalars(s, |b| unsigned(b) as f64),
            Some((Component::Signed(s), _)) => scalars(s, |b| signed(b) as f64),
            Some((_, n)) => self.attribute(bytes)[..n].iter().map(|v| f64::from(*v)).collect(),
            None if matches!(self.0, 2208..=2211) => scalars(8, float64),
            None if matches!(self.0, 2004..=2007 | 100 | 103) => scalars(4, |b| signed(b) as f64),
            None if matches!(self.0, 2104..=2107) => scalars(8, |b| unsigned(b) as f64),
            None => scalars(4, |b| f64::from(f32::from_ne_bytes([b[0], b[1], b[2], b[3]]))),
        }
    }
}

impl std::fmt::Debug for DataType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.name())
    }
}

impl std::fmt::Display for DataType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.name())
    }
}

fn unsigned(b: &[u8]) -> u64 {
    let mut wide = [0; 8];
    wide[..b.len()].copy_from_slice(b);
    // The device runs where the program runs. Numbers are little-endian on every platform that
    // ANARI supports.
    u64::from_le_bytes(wide)
}

fn signed(b: &[u8]) -> i64 {
    let unused = 64 - 8 * b.len() as u32;
    ((unsigned(b) << unused) as i64) >> unused
}

fn unsigned_max(bytes: usize) -> f64 {
    (u64::MAX >> (64 - 8 * bytes)) as f64
}

fn float64(b: &[u8]) -> f64 {
    let mut wide = [0; 8];
    wide.copy_from_slice(b);
    f64::from_ne_bytes(wide)
}

/// Converts IEEE 754 binary16.
fn half(bits: u16) -> f32 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, mantissa) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    sign * match exponent {
        0 => mantissa * (-24f32).exp2(),
        31 if mantissa == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        e => (1024.0 + mantissa) * ((e - 25) as f32).exp2(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_those_of_the_c_types() {
        let size = |t: DataType| t.size().unwrap_or(0);
        assert_eq!(size(DataType::FLOAT32_VEC3), 12);
        assert_eq!(size(DataType::UFIXED8_RGB_SRGB), 3);
        assert_eq!(size(DataType::FLOAT32_BOX3), 24);
        assert_eq!(size(DataType::FLOAT64_BOX1), 16);
        assert_eq!(size(DataType::FLOAT32_MAT4), 64);
        assert_eq!(size(DataType::GEOMETRY), 8);
        assert_eq!(DataType::STRING.size(), None);
        assert_eq!(DataType(77).size(), None);
        assert_eq!(DataType(1045).name(), "UFIXED16_VEC2");
    }

    #[test]
    fn fixed_point_and_srgb_reach_the_ends_of_their_ranges() {
        assert_eq!(DataType::UFIXED8_VEC4.attribute(&[255, 0, 51, 255]), [1.0, 0.0, 0.2, 1.0]);
        assert_eq!(
            DataType::FIXED16_VEC3.attribute(&[0xff, 0x7f, 0, 0x80, 0, 0])[..3],
            [1.0, -1.0, 0.0]
        );
        assert_eq!(DataType::UFIXED32.attribute(&[255; 4])[0], 1.0);
        assert_eq!(
            DataType::UFIXED8_RA_SRGB.attribute(&[255, 128]),
            [1.0, 128.0 / 255.0, 0.0, 1.0]
        );
        assert!((DataType::UFIXED8_RGB_SRGB.attribute(&[188, 0, 255])[0] - 0.5).abs() < 0.01);
    }

    #[test]
    fn half_floats_include_subnormals_and_infinity() {
        assert_eq!(
            [0x3c00, 0xc000, 0x0001, 0x7c00].map(half),
            [1.0, -2.0, (-24f32).exp2(), f32::INFINITY]
        );
        assert!(half(0x7e00).is_nan());
    }
}
