//! Reading any MCAP.
