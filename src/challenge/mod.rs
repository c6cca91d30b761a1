//! Concealed cases: made, sealed, analysed blind, revealed, scored.

pub mod conceal;
pub mod engine;
pub mod folder;
pub mod real;
pub mod run;
pub mod score;
pub mod seal;
