//! Terms of a loss that look at Gaussians, controllers and vertices (paper, sections IV-A and IV-C). Each returns its value times `weight`
//! and adds the derivatives, times `weight`, to an array of the layout of what it looks at.
