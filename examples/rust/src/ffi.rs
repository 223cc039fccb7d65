//! What this program calls of collide.h, declared as the header has it.

use std::ffi::{c_char, c_double, c_int, c_uint};

/// A status; 0 is COLLIDE_OK.
pub type Status = c_int;
pub const UNSUPPORTED: Status = 7;

/// A handle: never looked into, never made here.
#[repr(C)]
pub struct Handle {
    _private: [u8; 0],
}

/// A row of a pair, `collide_pair`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct Pair {
    pub distance: c_double,
    pub lower: c_double,
    pub upper: c_double,
    pub normal: [c_double; 3],
    pub point_a: [c_double; 3],
    pub point_b: [c_double; 3],
    pub a: i32,
    pub b: i32,
    pub part_a: i32,
    pub part_b: i32,
    pub vertices_a: [i32; 4],
    pub vertices_b: [i32; 4],
    pub iterations: i32,
    pub count: i32,
    pub how: i32,
    pub exact: u8,
    pub hit: u8,
    pub certified: u8,
    pub beyond: u8,
}

extern "C" {
    pub fn collide_version() -> *const c_char;
    pub fn collide_status_text(status: Status) -> *const c_char;

    pub fn collide_sphere(radius: c_double, shape: *mut *mut Handle) -> Status;
    pub fn collide_box(size: *const c_double, shape: *mut *mut Handle) -> Status;
    pub fn collide_shape_free(shape: *mut Handle);

    pub fn collide_workspace_create(workspace: *mut *mut Handle) -> Status;
    pub fn collide_workspace_free(workspace: *mut Handle);
    pub fn collide_distance(
        workspace: *mut Handle, a: *const Handle, b: *const Handle, x_wa: *const c_double, x_wb: *const c_double,
        max_distance: c_double, flags: c_uint, pair: *mut Pair,
    ) -> Status;

    pub fn collide_robot_load(path: *const c_char, robot: *mut *mut Handle) -> Status;
    pub fn collide_robot_free(robot: *mut Handle);
    pub fn collide_robot_columns(robot: *const Handle) -> usize;
    pub fn collide_robot_workspace_create(robot: *const Handle, workspace: *mut *mut Handle) -> Status;
    pub fn collide_robot_workspace_free(workspace: *mut Handle);
    pub fn collide_robot_collide(
        workspace: *mut Handle, configurations: *const c_double, n: usize, hits: *mut u8, statuses: *mut Status,
        failed: *mut usize,
    ) -> Status;
}
