//! The interface that the CPU's splatter shares with others.

use crate::attributes::Attributes;
use crate::error::GradientError;
use crate::picture::Picture;
use crate::splatter::{Drawn, Splatter};
use crate::view::{Twist, View};
use std::fmt::Debug;

/// What draws Gaussians and takes derivatives back to them: the CPU ([`Splatter`]), or another device. Two of them give the same but for rounding;
/// one gives the same bytes of the same inputs.
pub trait SplatDevice: Debug + Send {
    /// Draws Gaussians (world space) as a view sees them, before nothing.
    ///
    /// # Errors
    /// Too little memory, or a device that fails. The CPU's splatter never does.
    fn draw<'a>(
        &'a mut self,
        gaussians: &'a Attributes,
        view: &View,
    ) -> Result<Box<dyn Derivable + 'a>, GradientError>;
}

/// A picture that was drawn, with what its derivatives are computed from.
pub trait Derivable {
    /// What the view shows: premultiplied colours and alpha.
    fn picture(&self) -> &Picture;

    /// As [`Drawn::backward`].
    ///
    /// # Errors
    /// A picture of another size, another number of Gaussians, a device that fails: nothing was added then.
    fn backward(
        &mut self,
        by_pixel: &Picture,
        gradients: &mut Attributes,
    ) -> Result<Twist, GradientError>;
}

impl SplatDevice for Splatter {
    fn draw<'a>(
        &'a mut self,
        gaussians: &'a Attributes,
        view: &View,
    ) -> Result<Box<dyn Derivable + 'a>, GradientError> {
        Ok(Box::new(Self::draw(self, gaussians, view)))
    }
}

impl Derivable for Drawn<'_> {
    fn picture(&self) -> &Picture {
        Drawn::picture(self)
    }

    fn backward(
        &mut self,
        by_pixel: &Picture,
        gradients: &mut Attributes,
    ) -> Result<Twist, GradientError> {
        Drawn::backward(self, by_pixel, gradients)
    }
}
