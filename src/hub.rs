//! The one seam between producers and consumers of products.
