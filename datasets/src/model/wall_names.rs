//! How data sets say which parts of their border are walls: lists of points and of cells, and
//! names.

/// Name of the field data that lists the points of walls, counted from 0. A data set that has it
/// has no other walls.
pub const WALL_POINTS: &str = "wall points";

/// Name of the field data that lists walls without thickness: two cells for each face, counted from
/// 0, between which one stands.
pub const BAFFLES: &str = "baffles";

/// Words in names of patches and blocks that are bodies.
const BODIES: [&str; 30] = [
    "wall",
    "walls",
    "body",
    "bodies",
    "obstacle",
    "solid",
    "cylinder",
    "sphere",
    "airfoil",
    "aerofoil",
    "wing",
    "fuselage",
    "tail",
    "flap",
    "slat",
    "fin",
    "blade",
    "hull",
    "wedge",
    "cone",
    "ramp",
    "step",
    "plate",
    "nozzle",
    "model",
    "vehicle",
    "car",
    "building",
    "heatshield",
    "capsule",
];

/// Whether a name of a patch or block is that of a body: one of its words is.
///
/// ```
/// use datasets::model::is_name_of_body;
/// assert!(is_name_of_body("lowerWall") && is_name_of_body("boundary/cylinder_1"));
/// assert!(!is_name_of_body("outlet") && !is_name_of_body("infinity"));
/// ```
pub fn is_name_of_body(name: &str) -> bool {
    let mut words = vec![String::new()];
    let mut before_is_lower = false;
    for c in name.chars() {
        if !c.is_alphabetic() || c.is_uppercase() && before_is_lower {
            words.push(String::new());
        }
        before_is_lower = c.is_lowercase();
        if let Some(word) = words.last_mut().filter(|_| c.is_alphabetic()) {
            word.extend(c.to_lowercase());
        }
    }
    words.iter().any(|w| BODIES.contains(&w.as_str()))
}
