//! Protocols against independent decoders, golden frames and hostile bytes.

mod mit;
mod support;
