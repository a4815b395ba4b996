//! Other people's logs turned into recordings.
