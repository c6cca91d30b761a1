//! Concealed cases: made, sealed, analysed blind, revealed, scored.

pub mod conceal;
