use super::*;
use crate::kinematics::tests::model;

fn at_rest(arm: [f64; ARM_AXES]) -> AxisMotions {
    AxisMotions { axes: Axes::of_arm(arm).unwrap(), speeds: [0.0; AXES], accelerations: [0.0; AXES] }
}

fn near(got: [f64; AXES], want: [f64; ARM_AXES], within: f64) {
    for (n, (got, want)) in got.into_iter().zip(want).enumerate() {
        assert!((got - want).abs() < within, "J{}: {got}, not {want}", n + 1);
    }
    assert_eq!((got[6], got[7]), (0.0, 0.0));
}

/// Upper arm upright, forearm level. By hand: 9.81 m/s² times kg times metres in front of the joint, in Nm.
#[test]
fn holding_a_level_forearm_takes_what_the_lever_says() {
    let elbow = 9.81 * (8.0 * 0.1815 + 9.0 * (0.363 + 0.1183));
    let wrist = 9.81 * 9.0 * 0.1183;
    let want = [0.0, elbow / 230.0, elbow / 95.0, 0.0, wrist / 18.0, 0.0];
    near(torques(model(), &at_rest([0.0; 6])), want, 1e-6);
    // With J5 a quarter turn up the tool is above the wrist, so its lever for J2 and J3 is shorter.
    let up = torques(model(), &at_rest([0.0, 0.0, 0.0, 0.0, 90.0, 0.0]));
    assert!(up[4].abs() < 1e-6, "{}", up[4]);
    assert!((up[2] - 9.81 * (8.0 * 0.1815 + 9.0 * 0.363) / 95.0).abs() < 1e-6, "{}", up[2]);
}

#[test]
fn gaining_speed_takes_what_the_inertia_says() {
    // J1 accelerates by 100 degrees per second squared; the masses' squared distances from its axis, by hand.
    let mut motion = at_rest([0.0; 6]);
    motion.accelerations[0] = 100.0;
    let inertia =
        10.0 * 0.05_f64.powi(2) + 8.0 * (0.05 + 0.1815_f64).powi(2) + 9.0 * (0.05 + 0.4813_f64).powi(2);
    let torque = torques(model(), &motion)[0];
    assert!((torque - inertia * 100.0_f64.to_radians() / 120.0).abs() < 1e-6, "{torque}");
    motion.accelerations[0] = -100.0;
    assert!((torques(model(), &motion)[0] + torque).abs() < 1e-12);
}

#[test]
fn friction_goes_with_the_speed() {
    let mut motion = at_rest([0.0; 6]);
    let held = torques(model(), &motion);
    motion.speeds[1] = 135.0;
    let moving = torques(model(), &motion);
    assert!((moving[1] - held[1] - 0.1).abs() < 1e-12, "half of full speed: {}", moving[1] - held[1]);
}

#[test]
fn sliding_axes_carry_weights() {
    let scara = RobotModel::named("GENERIC-SCARA").unwrap();
    near(torques(scara, &at_rest([0.0; 6])), [0.0, 0.0, 9.81 * 6.0 / 99.0, 0.0, 0.0, 0.0], 1e-6);
    let gantry = RobotModel::named("GENERIC-CARTESIAN").unwrap();
    let mut motion = at_rest([0.0; 6]);
    motion.accelerations[0] = 2000.0;
    near(torques(gantry, &motion), [2.0 * 110.0 / 480.0, 0.0, 9.81 * 20.0 / 330.0, 0.0, 0.0, 0.0], 1e-6);
}

#[test]
fn an_arm_of_unknown_weight_has_friction_only() {
    let mut weightless = model().clone();
    weightless.masses = None;
    let mut motion = at_rest([0.0; 6]);
    motion.speeds[0] = 220.8;
    motion.accelerations[1] = 50.0;
    near(torques(&weightless, &motion), [0.2, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-12);
}

/// Model files say of their chosen torques that they hold the stretched arm with six tenths at most.
#[test]
fn no_model_asks_for_more_than_rated_at_rest() {
    for name in RobotModel::names() {
        let model = RobotModel::named(name).unwrap();
        for step in 0..=20 {
            let mut arm = [0.0; 6];
            for (slot, axis) in arm.iter_mut().zip(model.drives()).skip(1) {
                *slot = axis.soft.min + (axis.soft.max - axis.soft.min) * f64::from(step) / 20.0;
            }
            for torque in torques(model, &at_rest(arm)) {
                assert!(torque.abs() <= 0.61, "{name}: {torque}");
            }
        }
    }
}
