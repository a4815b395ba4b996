//! End-to-end tests live in `tests/tests`: they run the commands on real files, as a person would.
