//! The camera: orbits around a point. Projects points of the arm's frame (mm) to CSS pixels, and converts pixels to rays.

use glam::{Mat4, Vec2, Vec3, Vec4};

/// Vertical angle of view in radians.
const FIELD_OF_VIEW: f32 = 0.6;
/// The nearest and the farthest visible depth, in mm.
const NEAR: f32 = 40.0;
const FAR: f32 = 6_000.0;
/// The initial target in the middle of the picture, and the distance to it, in mm.
const STANDARD_TARGET: Vec3 = Vec3::new(0.0, 100.0, 95.0);
const STANDARD_DISTANCE: f32 = 840.0;
/// Bounds of the distance to the target, in mm.
const DISTANCE: [f32; 2] = [250.0, 3_000.0];
/// Bounds of the elevation, in radians: from slightly below the horizontal to almost vertically above the arm.
const ELEVATION: [f32; 2] = [-0.15, 1.55];
/// Bounds of each coordinate of the target, in mm.
const TARGET: [f32; 2] = [-500.0, 500.0];
/// The angle by which a drag of one CSS pixel turns the camera, in radians.
const TURN_PER_PIXEL: f32 = 0.008;

/// A half line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Its start, in mm.
    pub origin: Vec3,
    /// Its direction, of length 1.
    pub direction: Vec3,
}

/// A fixed direction of view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// From the front right and above: the initial view.
    Corner,
    /// From the front: the arm points towards the camera.
    Front,
    /// From the right side.
    Side,
    /// From above.
    Top,
}

/// The position and direction from which the scene is seen. Angles in radians, lengths in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The point in the middle of the picture.
    target: Vec3,
    /// The direction from the target to the camera, seen from above: 0 is along x, to the right of the arm.
    azimuth: f32,
    /// The angle of the camera above the horizontal plane through the target.
    elevation: f32,
    distance: f32,
    /// Width and height of the picture in CSS pixels.
    size: Vec2,
}

impl Default for Camera {
    fn default() -> Self {
        let mut camera = Self {
            target: STANDARD_TARGET,
            azimuth: 0.0,
            elevation: 0.0,
            distance: STANDARD_DISTANCE,
            size: Vec2::new(1280.0, 720.0),
        };
        camera.look_from(Preset::Corner);
        camera
    }
}

impl Camera {
    /// Sets the size of the picture in CSS pixels. Sizes below 1 count as 1.
    pub fn resize(&mut self, width: f32, height: f32) {
        self.size = Vec2::new(width.max(1.0), height.max(1.0));
    }

    /// Switches to a fixed direction, with the initial target and distance.
    pub fn look_from(&mut self, preset: Preset) {
        (self.azimuth, self.elevation) = match preset {
            Preset::Corner => (0.45, 0.42),
            Preset::Front => (std::f32::consts::FRAC_PI_2, 0.12),
            Preset::Side => (0.0, 0.12),
            Preset::Top => (-std::f32::consts::FRAC_PI_2, ELEVATION[1]),
        };
        self.target = STANDARD_TARGET;
        self.distance = STANDARD_DISTANCE;
    }

    /// Orbits around the target by a drag in CSS pixels. A drag to the right moves the near side of the scene to the right.
    pub fn orbit(&mut self, right: f32, down: f32) {
        self.azimuth = (self.azimuth - right * TURN_PER_PIXEL).rem_euclid(std::f32::consts::TAU);
        let [low, high] = ELEVATION;
        self.elevation = (self.elevation + down * TURN_PER_PIXEL).clamp(low, high);
    }

    /// Multiplies the distance by this factor: below 1 moves the camera nearer. The distance stays within its bounds.
    pub fn zoom(&mut self, factor: f32) {
        let [low, high] = DISTANCE;
        self.distance = (self.distance * factor).clamp(low, high);
    }

    /// Moves the target so that the scene follows a drag in CSS pixels.
    pub fn pan(&mut self, right: f32, down: f32) {
        let per_pixel = 2.0 * self.distance_for_height() * (FIELD_OF_VIEW / 2.0).tan() / self.size.y;
        let (across, up) = self.screen_axes();
        let [low, high] = TARGET;
        let target = self.target - across * (right * per_pixel) + up * (down * per_pixel);
        self.target = target.clamp(Vec3::splat(low), Vec3::splat(high));
    }

    /// The unit vectors to the right and up in the picture, in the arm's frame.
    #[must_use]
    pub fn screen_axes(&self) -> (Vec3, Vec3) {
        let across = Vec3::new(-self.azimuth.sin(), self.azimuth.cos(), 0.0);
        (across, self.backward().cross(across))
    }

    /// The position of the camera, in mm.
    #[must_use]
    pub fn position(&self) -> Vec3 {
        self.target + self.backward() * self.distance_for_height()
    }

    /// The transform from the arm's frame, in mm, to clip space.
    #[must_use]
    pub fn view_projection(&self) -> Mat4 {
        let (across, up) = self.screen_axes();
        let back = self.backward();
        let turn = Mat4::from_cols(across.extend(0.0), up.extend(0.0), back.extend(0.0), Vec4::W).transpose();
        let aspect = self.size.x / self.size.y;
        perspective(FIELD_OF_VIEW, aspect) * turn * Mat4::from_translation(-self.position())
    }

    /// Projects a point of the arm's frame, in mm, to CSS pixels from the top left. `None` if the point is behind the camera, or
    /// less than 20 mm in front of it.
    #[must_use]
    pub fn project(&self, point: Vec3) -> Option<Vec2> {
        let clip = self.view_projection() * point.extend(1.0);
        (clip.w > NEAR / 2.0).then(|| {
            let across = Vec2::new(clip.x, -clip.y) / clip.w;
            (across + Vec2::ONE) * 0.5 * self.size
        })
    }

    /// The half line from the camera through a pixel, in CSS pixels from the top left.
    #[must_use]
    pub fn ray(&self, pixel: Vec2) -> Ray {
        let across = pixel / self.size * 2.0 - Vec2::ONE;
        let (right, up) = self.screen_axes();
        let half_height = (FIELD_OF_VIEW / 2.0).tan();
        let sideways = right * (across.x * half_height * self.size.x / self.size.y);
        let direction = sideways - up * (across.y * half_height) - self.backward();
        Ray { origin: self.position(), direction: direction.normalize() }
    }

    /// Intersects the half line through a pixel (CSS pixels from the top left) with the plane that contains the point `through`
    /// and is parallel to the screen. Points are in mm.
    #[must_use]
    pub fn on_facing_plane(&self, pixel: Vec2, through: Vec3) -> Vec3 {
        let (ray, back) = (self.ray(pixel), self.backward());
        // The ray points forward, so its component along `back` is negative. `min` keeps the divisor away from 0.
        let depth = (through - ray.origin).dot(back) / ray.direction.dot(back).min(-1e-3);
        ray.origin + ray.direction * depth
    }

    /// The unit vector from the target to the camera.
    fn backward(&self) -> Vec3 {
        let (sine, cosine) = self.azimuth.sin_cos();
        let (up, level) = self.elevation.sin_cos();
        Vec3::new(cosine * level, sine * level, up)
    }

    /// The distance to the target, increased if the picture is higher than wide (phones), so that the arm is not cut off.
    fn distance_for_height(&self) -> f32 {
        self.distance * (self.size.y / self.size.x).max(1.0)
    }
}

/// The perspective projection of OpenGL, with a depth from -1 to 1.
fn perspective(field_of_view: f32, aspect: f32) -> Mat4 {
    let scale = 1.0 / (field_of_view / 2.0).tan();
    let depth = NEAR - FAR;
    Mat4::from_cols(
        Vec4::new(scale / aspect, 0.0, 0.0, 0.0),
        Vec4::new(0.0, scale, 0.0, 0.0),
        Vec4::new(0.0, 0.0, (FAR + NEAR) / depth, -1.0),
        Vec4::new(0.0, 0.0, 2.0 * FAR * NEAR / depth, 0.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_through_a_projected_point_meets_the_point() {
        let mut camera = Camera::default();
        for turn in [(0.0, 0.0), (200.0, -100.0), (-500.0, 60.0), (30.0, 500.0)] {
            camera.orbit(turn.0, turn.1);
            camera.pan(13.0, -7.0);
            for point in [Vec3::ZERO, Vec3::new(120.0, 220.0, 160.0), Vec3::new(-90.0, 40.0, -60.0)] {
                let pixel = camera.project(point).expect("in front of the camera");
                let ray = camera.ray(pixel);
                let beside = (point - ray.origin).cross(ray.direction).length();
                assert!(beside < 0.05, "{point} is {beside} mm beside the ray");
                assert!((camera.on_facing_plane(pixel, point) - point).length() < 0.1);
            }
        }
    }

    #[test]
    fn the_target_is_in_the_middle_and_up_is_up() {
        let camera = Camera::default();
        let middle = camera.project(STANDARD_TARGET).expect("in front");
        assert!((middle - Vec2::new(640.0, 360.0)).length() < 0.01, "{middle}");
        let above = camera.project(STANDARD_TARGET + Vec3::Z * 20.0).expect("in front");
        assert!(above.y < middle.y - 10.0, "{above}");
    }

    #[test]
    fn from_above_right_is_right_and_forward_is_up() {
        let mut camera = Camera::default();
        camera.look_from(Preset::Top);
        let at = |x, y| camera.project(Vec3::new(x, y, 0.0)).expect("in front");
        assert!(at(100.0, 0.0).x > at(0.0, 0.0).x + 50.0);
        assert!(at(0.0, 100.0).y < at(0.0, 0.0).y - 50.0);
    }

    #[test]
    fn a_pan_follows_the_pointer() {
        let mut camera = Camera::default();
        let point = STANDARD_TARGET;
        let before = camera.project(point).expect("in front");
        camera.pan(50.0, 30.0);
        let moved = camera.project(point).expect("in front") - before;
        assert!((moved - Vec2::new(50.0, 30.0)).length() < 0.5, "{moved}");
    }

    #[test]
    fn a_point_behind_the_camera_has_no_pixel() {
        let camera = Camera::default();
        let behind = camera.position() * 2.0 - STANDARD_TARGET;
        assert_eq!(camera.project(behind), None);
    }

    #[test]
    fn distance_and_elevation_are_bounded() {
        let mut camera = Camera::default();
        camera.zoom(1e-9);
        assert_eq!(camera.distance, DISTANCE[0]);
        camera.zoom(1e9);
        assert_eq!(camera.distance, DISTANCE[1]);
        camera.orbit(0.0, 1e6);
        assert_eq!(camera.elevation, ELEVATION[1]);
    }
}
