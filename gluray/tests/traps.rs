//! What programs of all kinds turned out to do, one small program each: the driver's picture, and traced.

mod common;

use common::cases::{Expected, check};

macro_rules! cases {
    ($($name:ident: $traced:literal $options:expr;)*) => { $(
        #[test]
        fn $name() {
            check("traps.py", stringify!($name), &Expected { traced: $traced, exit: 0 }, &$options);
        }
    )* };
}

cases! {
    generated_lists_with_state_between_primitives: true [];
}
