//! One suite for every backend: a store has the same bytes whoever evaluates its bricks.
//!
//! The instances for Vulkan, with and without copies to and from the device, need one, which a software driver can be, and
//! the validation layer, which must have nothing to say. They are ignored by default, for a machine may have neither:
//! `cargo test --test vulkan -- --ignored --test-threads 1` runs them, and fails without them. One at a time: the validation
//! layer reads its table of devices while other threads may write to it.

#[path = "vulkan/backend.rs"]
mod backend;
#[path = "vulkan/check.rs"]
mod check;
#[path = "vulkan/device.rs"]
mod device;
#[path = "vulkan/rays.rs"]
mod rays;
#[path = "vulkan/splats.rs"]
mod splats;
#[path = "vulkan/suite.rs"]
mod suite;

/// The suite on one backend.
macro_rules! instance {
    ($name:ident, $(#[$attribute:meta])*) => {
        mod $name {
            use crate::{backend, suite};

            $(#[$attribute])*
            #[test]
            fn meshes_give_the_same_store() {
                backend::$name(suite::meshes_give_the_same_store);
            }

            $(#[$attribute])*
            #[test]
            fn beads_give_the_same_store() {
                backend::$name(suite::beads_give_the_same_store);
            }

            $(#[$attribute])*
            #[test]
            fn piles_on_the_lattice_give_the_same_store() {
                backend::$name(suite::piles_on_the_lattice_give_the_same_store);
            }

            $(#[$attribute])*
            #[test]
            fn any_triangles_give_the_same_store() {
                backend::$name(suite::any_triangles_give_the_same_store);
            }

            $(#[$attribute])*
            #[test]
            fn open_soups_give_the_same_store() {
                backend::$name(suite::open_soups_give_the_same_store);
            }

            $(#[$attribute])*
            #[test]
            fn trees_that_decide_give_the_same_store() {
                backend::$name(suite::trees_that_decide_give_the_same_store);
            }

            $(#[$attribute])*
            #[test]
            fn thin_walls_that_are_divided_give_the_same_store() {
                backend::$name(suite::thin_walls_that_are_divided_give_the_same_store);
            }

            $(#[$attribute])*
            #[test]
            fn interrupted_builds_go_on_to_the_same_store() {
                backend::$name(suite::interrupted_builds_go_on_to_the_same_store);
            }
        }
    };
}

instance!(cpu,);
instance!(vulkan, #[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]);
instance!(staged, #[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]);
