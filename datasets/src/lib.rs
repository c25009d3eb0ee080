//! Generators, readers and writers of data sets.
