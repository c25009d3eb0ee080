//! Changes of the flow by the page: which arrays make the index, and how they become a lattice.

use super::{MAX_NODES, RefusedChange, Session, refused};
use crate::scene::FlowSpec;
use crate::serve::merge_patch::merge;
use serde_json::{Map, Value};

/// The arrays of the index. Each of the first three is an alternative to the others.
const MEDIUM_KEYS: [&str; 4] = ["density", "temperature", "n_minus_1", "pressure"];
/// How the data become a lattice, or that light is traced through their cells.
const LATTICE_KEYS: [&str; 7] = [
    "outside",
    "hidden",
    "reconstruction",
    "on_cells",
    "smoothing_nodes",
    "average_jumps",
    "resample_nodes",
];

/// The names of `flow` that cannot be changed from the page are refused: files above all.
pub(super) fn check_keys(flow: &Map<String, Value>) -> Result<(), RefusedChange> {
    let known = |k: &&String| {
        *k == "multifield"
            || MEDIUM_KEYS.contains(&k.as_str())
            || LATTICE_KEYS.contains(&k.as_str())
    };
    if flow.keys().all(|k| known(&k)) {
        return Ok(());
    }
    let keys: Vec<String> =
        MEDIUM_KEYS.iter().chain(&LATTICE_KEYS).map(|k| format!("`{k}`")).collect();
    Err(refused(format!(
        "of the flow only `multifield`, {} can be changed from the page; start the program with \
         other options",
        keys.join(", ")
    )))
}

impl Session {
    /// The flow after a change. `medium` is the last one whose index came from arrays and not from
    /// transfer functions.
    pub(super) fn flow_after(
        &self,
        before: &FlowSpec,
        medium: &FlowSpec,
        change: &Map<String, Value>,
    ) -> Result<FlowSpec, RefusedChange> {
        let curves = change.get("multifield");
        let arrays: Vec<(&str, &Value)> =
            MEDIUM_KEYS.into_iter().filter_map(|k| Some((k, change.get(k)?))).collect();
        let of_index: Vec<&str> = arrays.iter().map(|a| a.0).filter(|k| *k != "pressure").collect();
        if of_index.len() > 1 {
            return Err(refused(format!("{} are alternatives; give one", of_index.join(" and "))));
        }
        let mut flow = match curves {
            None => before.clone(),
            Some(Value::Null) => FlowSpec {
                file: before.file.clone(),
                resample_nodes: before.resample_nodes,
                smoothing_nodes: before.smoothing_nodes,
                average_jumps: before.average_jumps,
                outside: before.outside,
                hidden: before.hidden,
                reconstruction: before.reconstruction,
                on_cells: before.on_cells,
                ..medium.clone()
            },
            Some(curves) if arrays.is_empty() => self.with_curves(before, curves)?,
            Some(_) => {
                return Err(refused(format!(
                    "`multifield` and `{}` are alternatives; give one",
                    arrays[0].0
                )));
            }
        };
        if curves == Some(&Value::Null) && flow.multifield.is_some() && arrays.is_empty() {
            return Err(refused(
                "the program was started with transfer functions; choose the arrays of the index \
                 to end them",
            ));
        }
        for (key, name) in arrays {
            set_array(&mut flow, key, self.array(key, name)?);
        }
        let lattice: Map<String, Value> = change
            .iter()
            .filter(|(k, _)| LATTICE_KEYS.contains(&k.as_str()))
            .map(|(k, v)| (k.clone(), v.clone()))
            .collect();
        if lattice.is_empty() {
            return Ok(flow);
        }
        let mut value = serde_json::to_value(&flow).map_err(|e| refused(e.to_string()))?;
        merge(&mut value, Value::Object(lattice));
        let flow: FlowSpec =
            serde_json::from_value(value).map_err(|e| refused(format!("not a flow: {e}")))?;
        match flow.resample_nodes {
            Some(n) if Some(n) != before.resample_nodes && !(4..=MAX_NODES).contains(&n) => {
                Err(refused(format!(
                    "flow.resample_nodes is {n}; the page takes 4 to {MAX_NODES}: start the \
                     program with --resample for more"
                )))
            }
            _ => Ok(flow),
        }
    }

    /// An array of the file, a number, or what the program started with.
    fn array(&self, key: &str, name: &Value) -> Result<String, RefusedChange> {
        let Some(name) = name.as_str() else {
            return Err(refused(format!("`{key}` is {name}; give the name of an array")));
        };
        let number = name.trim().parse::<f64>().is_ok_and(f64::is_finite);
        let given = self.given.iter().any(|g| g == name);
        if number || given || self.arrays.iter().any(|a| a.name == name) {
            return Ok(name.to_owned());
        }
        Err(self.no_array(name))
    }

    fn no_array(&self, name: &str) -> RefusedChange {
        let names: Vec<&str> = self.arrays.iter().map(|a| a.name.as_str()).collect();
        refused(format!("there is no array `{name}`; there are: {}", names.join(", ")))
    }

    fn with_curves(&self, before: &FlowSpec, curves: &Value) -> Result<FlowSpec, RefusedChange> {
        if self.arrays.len() < 2 {
            return Err(refused(
                "the flow has fewer than two arrays; transfer functions are for several",
            ));
        }
        let multifield = serde_json::from_value(curves.clone())
            .map_err(|e| refused(format!("not transfer functions: {e}")))?;
        let flow = FlowSpec { multifield: Some(multifield), ..before.without_medium() };
        for name in flow.multifield.iter().flat_map(|m| m.fields.keys()) {
            if !self.arrays.iter().any(|a| a.name == *name) {
                return Err(self.no_array(name));
            }
        }
        Ok(flow)
    }
}

/// Names an array of the index. Another kind of index leaves nothing of the old one behind, as on
/// the command line; the same kind keeps its units.
fn set_array(flow: &mut FlowSpec, key: &str, name: String) {
    let same = match key {
        "density" => flow.density.is_some(),
        "n_minus_1" => flow.n_minus_1.is_some(),
        // A pressure belongs to the temperature.
        _ => flow.temperature.is_some(),
    };
    if !same && key != "pressure" {
        let reference_n_minus_1 = flow.reference_n_minus_1;
        *flow = FlowSpec { reference_n_minus_1, ..flow.without_medium() };
    }
    let array = match key {
        "density" => &mut flow.density,
        "n_minus_1" => &mut flow.n_minus_1,
        "pressure" => &mut flow.pressure,
        _ => &mut flow.temperature,
    };
    *array = Some(name);
}
