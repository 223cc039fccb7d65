//! Two shapes, and a robot that Python saved, asked from Rust.
//!
//!     cargo run --offline [ROBOT.collide]
//!
//! Every handle has an owner that frees it. Shapes and robots never change, so that threads share them; a workspace belongs to
//! one thread at a time, which the borrow of `&mut self` keeps.

mod ffi;

use std::ffi::{CStr, CString};
use std::fmt;
use std::ptr::null_mut;

#[derive(Debug)]
struct Error(ffi::Status);

impl fmt::Display for Error {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        out.write_str(&text(unsafe { ffi::collide_status_text(self.0) }))
    }
}

impl std::error::Error for Error {}

fn text(words: *const std::ffi::c_char) -> String {
    unsafe { CStr::from_ptr(words) }.to_string_lossy().into_owned()
}

fn check(status: ffi::Status) -> Result<(), Error> {
    if status == 0 { Ok(()) } else { Err(Error(status)) }
}

/// Owns a handle that the library made.
struct Owner {
    handle: *mut ffi::Handle,
    free: unsafe extern "C" fn(*mut ffi::Handle),
}

impl Owner {
    fn made(free: unsafe extern "C" fn(*mut ffi::Handle), make: impl FnOnce(*mut *mut ffi::Handle) -> ffi::Status) -> Result<Owner, Error> {
        let mut handle = null_mut();
        check(make(&mut handle))?;
        Ok(Owner { handle, free })
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        unsafe { (self.free)(self.handle) }
    }
}

struct Shape(Owner);
unsafe impl Send for Shape {}
unsafe impl Sync for Shape {}

impl Shape {
    fn sphere(radius: f64) -> Result<Shape, Error> {
        Owner::made(ffi::collide_shape_free, |out| unsafe { ffi::collide_sphere(radius, out) }).map(Shape)
    }
    fn cuboid(size: [f64; 3]) -> Result<Shape, Error> {
        Owner::made(ffi::collide_shape_free, |out| unsafe { ffi::collide_box(size.as_ptr(), out) }).map(Shape)
    }
}

struct Workspace(Owner);
unsafe impl Send for Workspace {}

impl Workspace {
    fn new() -> Result<Workspace, Error> {
        Owner::made(ffi::collide_workspace_free, |out| unsafe { ffi::collide_workspace_create(out) }).map(Workspace)
    }
    /// Poses are 4x4 matrices, row by row.
    fn distance(&mut self, a: &Shape, b: &Shape, x_wa: &[f64; 16], x_wb: &[f64; 16]) -> Result<ffi::Pair, Error> {
        let mut pair = ffi::Pair::default();
        let (x, y) = (x_wa.as_ptr(), x_wb.as_ptr());
        check(unsafe { ffi::collide_distance(self.0.handle, a.0.handle, b.0.handle, x, y, f64::INFINITY, 0, &mut pair) })?;
        Ok(pair)
    }
}

struct Robot(Owner);
unsafe impl Send for Robot {}
unsafe impl Sync for Robot {}

impl Robot {
    fn load(path: &str) -> Result<Robot, Box<dyn std::error::Error>> {
        let path = CString::new(path)?;
        Ok(Robot(Owner::made(ffi::collide_robot_free, |out| unsafe { ffi::collide_robot_load(path.as_ptr(), out) })?))
    }
    fn columns(&self) -> usize {
        unsafe { ffi::collide_robot_columns(self.0.handle) }
    }
}

/// Questions about a robot, which outlives them.
struct RobotWorkspace<'a> {
    own: Owner,
    robot: &'a Robot,
}

impl<'a> RobotWorkspace<'a> {
    fn new(robot: &'a Robot) -> Result<RobotWorkspace<'a>, Error> {
        let made = |out| unsafe { ffi::collide_robot_workspace_create(robot.0.handle, out) };
        Ok(RobotWorkspace { own: Owner::made(ffi::collide_robot_workspace_free, made)?, robot })
    }
    /// Whether each row of `columns` values collides; `None` where only Python can tell.
    fn collides(&mut self, configurations: &[f64]) -> Result<Vec<Option<bool>>, Error> {
        let n = configurations.len() / self.robot.columns().max(1);
        let (mut hits, mut statuses) = (vec![0u8; n], vec![0; n]);
        let status = unsafe {
            ffi::collide_robot_collide(self.own.handle, configurations.as_ptr(), n, hits.as_mut_ptr(), statuses.as_mut_ptr(), null_mut())
        };
        if status != ffi::UNSUPPORTED {
            check(status)?;
        }
        Ok(hits.iter().zip(&statuses).map(|(&hit, &status)| (status == 0).then_some(hit != 0)).collect())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let at = |x: f64| [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let (block, ball) = (Shape::cuboid([1.0, 2.0, 0.5])?, Shape::sphere(0.25)?);
    let pair = Workspace::new()?.distance(&block, &ball, &at(0.0), &at(2.0))?;
    println!("collide {}: {} m apart, within [{}, {}]", text(unsafe { ffi::collide_version() }), pair.distance, pair.lower, pair.upper);
    println!("a sphere of radius -1: {}", Shape::sphere(-1.0).err().map_or_else(String::new, |error| error.to_string()));
    if let Some(path) = std::env::args().nth(1) {
        let robot = Robot::load(&path)?;
        // Two threads, each with a workspace, share the robot: one asks about zeros, one about a tenth everywhere.
        let answers: Vec<_> = std::thread::scope(|scope| {
            let asked = [0.0, 0.1].map(|value| {
                let robot = &robot;
                scope.spawn(move || RobotWorkspace::new(robot)?.collides(&vec![value; robot.columns()]))
            });
            asked.into_iter().map(|thread| thread.join().expect("a thread ends")).collect::<Result<_, Error>>()
        })?;
        println!("robot of {} columns: {:?}", robot.columns(), answers);
    }
    Ok(())
}
