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
    quads_of_immediate_mode: true [];
    quads_of_which_one_is_clipped: true [];
    quads_of_a_display_list: true [];
    quads_of_a_list_that_is_passed: false [];
    quads_by_index: true [];
    arrays_of_a_list_leave_the_current_normal_alone: true [];
    strips_that_restart_within_a_list: true [];
    a_second_texture_is_bound_right_after_a_draw_with_the_first: true [];
    things_around_the_viewer: true [];
    masks_that_tell_front_from_back: true ["--trace", "all"];
}
