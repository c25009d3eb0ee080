//! The module for Fortran 2018 (`iso_c_binding`).

use crate::model::{Field, Item, Kind, array_of, is_function, layout, wrapped};
use std::fmt::Write as _;

/// Arguments that are several structures or numbers, one behind the other.
const SEVERAL: &[&str] = &["tiles", "images", "order"];

/// The type of a member or a value, and what a member is at first.
fn simple(rust: &str) -> (String, &'static str) {
    let (fortran, zero) = match rust {
        "u32" | "i32" | "RtsvCompositeStatus" => ("integer(c_int32_t)", "0"),
        "u64" | "i64" => ("integer(c_int64_t)", "0"),
        "f32" => ("real(c_float)", "0"),
        "f64" => ("real(c_double)", "0"),
        function if is_function(function) => ("type(c_funptr)", "c_null_funptr"),
        pointer if pointer.starts_with('*') => ("type(c_ptr)", "c_null_ptr"),
        ours => return (format!("type({ours})"), ""),
    };
    (fortran.to_owned(), zero)
}

fn argument(Field { name, rust, .. }: &Field, handles: &[&str]) -> String {
    let several = if SEVERAL.contains(&name.as_str()) { "(*)" } else { "" };
    let pointer = rust.strip_prefix("*const ").map(|to| (to, "in"));
    let pointer = pointer.or_else(|| rust.strip_prefix("*mut ").map(|to| (to, "inout")));
    match pointer {
        None => format!("{}, value :: {name}", simple(rust).0),
        Some(("c_void", _)) => format!("type(c_ptr), value :: {name}"),
        Some(("c_char", _)) => format!("character(kind=c_char), intent(in) :: {name}(*)"),
        Some((to, _)) if handles.contains(&to) => format!("type(c_ptr), value :: {name}"),
        Some((to, _)) if to.starts_with('*') => format!("type(c_ptr), intent(out) :: {name}"),
        Some((to, intent)) => {
            format!("{}, intent({intent}), optional :: {name}{several}", simple(to).0)
        }
    }
}

fn describe(out: &mut String, indent: &str, about: &str) {
    for line in wrapped(about, 94 - indent.len()) {
        writeln!(out, "{indent}! {line}").expect("to a string");
    }
}

/// The text of the module.
pub(crate) fn module(items: &[Item]) -> String {
    let handles: Vec<&str> =
        items.iter().filter(|i| matches!(i.kind, Kind::Handle)).map(|i| i.name.as_str()).collect();
    let mut out = String::from(
        "! The interface of composite for Fortran: what rtsv_composite.h is for C, which says what\n\
         ! each call does. Handles are type(c_ptr), texts end with c_null_char, and what may be null\n\
         ! in C is optional. Made from the Rust sources by tests/interface: do not edit.\n\
         module rtsv_composite\n  use, intrinsic :: iso_c_binding\n  implicit none\n  public\n\n",
    );
    for Item { name, about, kind } in items {
        match kind {
            Kind::Constant(value) => {
                let value = match value.strip_prefix("0x") {
                    Some(digits) => u32::from_str_radix(digits, 16).expect("digits").to_string(),
                    None => value.clone(),
                };
                describe(&mut out, "  ", about);
                writeln!(out, "  integer(c_int32_t), parameter :: {name} = {value}")
            }
            Kind::Structure(fields) => {
                describe(&mut out, "  ", about);
                writeln!(out, "  type, bind(c) :: {name}").expect("to a string");
                for field in fields {
                    describe(&mut out, "    ", &field.about);
                    let (of, count) = array_of(&field.rust).map_or((field.rust.as_str(), 0), |a| a);
                    let (fortran, zero) = simple(of);
                    let count = if count > 0 { format!("({count})") } else { String::new() };
                    let first = match field.name.as_str() {
                        "struct_bytes" => format!(" = {}", layout(name, items).0),
                        _ if zero.is_empty() => String::new(),
                        _ => format!(" = {zero}"),
                    };
                    writeln!(out, "    {fortran} :: {}{count}{first}", field.name)
                        .expect("to a string");
                }
                writeln!(out, "  end type")
            }
            Kind::Alias(_) | Kind::Handle | Kind::Function { .. } => Ok(()),
        }
        .expect("to a string");
    }
    out += "\n  interface\n";
    for Item { name, kind, .. } in items {
        let Kind::Function { arguments, result } = kind else { continue };
        let names: Vec<&str> = arguments.iter().map(|a| a.name.as_str()).collect();
        let names = names.join(", ");
        writeln!(out, "    function {name}({names}) &\n        result(status) bind(c)")
            .expect("to a string");
        out += "      import\n";
        for field in arguments {
            writeln!(out, "      {}", argument(field, &handles)).expect("to a string");
        }
        writeln!(out, "      {} :: status\n    end function", simple(result).0)
            .expect("to a string");
    }
    out + "  end interface\nend module\n"
}
