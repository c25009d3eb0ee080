//! Compiles and runs the Rust examples of the book (docs/src) and of READMEs as documentation
//! tests, so that they stay correct.
//!
//! They are in bench because it may use every member, as an example may. The test
//! `the_book_is_complete` finds chapters with examples that are missing here.

macro_rules! chapters {
    ($($name:ident $path:literal)*) => {
        $(
            #[cfg(doctest)]
            #[doc = include_str!($path)]
            mod $name {}
        )*
    };
}

chapters! {
    composite_rendering "../../docs/src/composite/rendering.md"
    composite_running "../../docs/src/composite/running.md"
    datasets_generators "../../docs/src/datasets/generators.md"
    rt_core_embedding "../../docs/src/rt-core/embedding.md"
    rt_core_geometry "../../docs/src/rt-core/geometry.md"
    numerical_methods "../../docs/src/numerical_methods.md"
    your_own_file "../../docs/src/your_own_file.md"
    readme "../../README.md"
    rt_core_readme "../../rt-core/README.md"
    datasets_readme "../../datasets/README.md"
    composite_readme "../../composite/README.md"
}
