//! The shell on a scan of the body model itself, whose registration is exact.

mod scene;

use super::*;
use scene::Scene;
