package RotationalExamples "The examples of Modelica.Mechanics.Rotational 4.1.0, written anew from their topology and values"
  import Modelica.Units.SI;
  import Modelica.Blocks.Sources;
  import Modelica.Mechanics.Rotational;
  import Modelica.Mechanics.Rotational.Components.*;

  partial model Example "What every example extends"
    extends Modelica.Icons.Example;
  end Example;

  model FirstGrounded "A motor with a gear drives a load through a spring"
    extends Example;
    parameter SI.Torque amplitude = 10 "amplitude of the driving torque";
    parameter SI.Frequency f = 5 "frequency of the driving torque";
    parameter SI.Inertia Jmotor(min = 0) = 0.1 "motor";
    parameter SI.Inertia Jload(min = 0) = 2 "load";
    parameter Real ratio = 10 "gear ratio";
    parameter Real damping = 10 "damping in the bearing of the gear";
    Fixed fixed;
    Rotational.Sources.Torque torque(useSupport = false);
    Inertia inertia1(J = Jmotor);
    IdealGear idealGear(ratio = ratio, useSupport = false);
    Inertia inertia2(J = 2, phi(fixed = true, start = 0), w(fixed = true));
    Spring spring(c = 1.e4, phi_rel(fixed = true));
    Inertia inertia3(J = Jload, w(fixed = true));
    Damper damper(d = damping);
    Sources.Sine sine(amplitude = amplitude, f = f);
  equation
    connect(inertia1.flange_b, idealGear.flange_a);
    connect(idealGear.flange_b, inertia2.flange_a);
    connect(inertia2.flange_b, spring.flange_a);
    connect(spring.flange_b, inertia3.flange_a);
    connect(damper.flange_a, inertia2.flange_b);
    connect(damper.flange_b, fixed.flange);
    connect(sine.y, torque.tau);
    connect(torque.flange, inertia1.flange_a);
    annotation (experiment(StopTime = 1.0, Interval = 0.001));
  end FirstGrounded;

  model First "The same with the supports of torque and gear on one housing"
    extends FirstGrounded(torque(useSupport = true), idealGear(useSupport = true));
  equation
    connect(torque.support, fixed.flange);
    connect(idealGear.support, fixed.flange);
  end First;

  model Friction "A drive with a clutch and a brake"
    extends Example;
    parameter SI.Time startTime = 0.5 "when the motor stops and the brake starts";
    output Real tMotor = torque.tau "driving torque";
    output Real w1 = inertia1.w;
    Rotational.Sources.Torque torque(useSupport = true);
    Inertia inertia3(J = 1, phi(start = 0, fixed = true), w(start = 100, fixed = true));
    Clutch clutch(fn_max = 160);
    Inertia inertia2(J = 0.05, phi(start = 0, fixed = true), w(start = 90, fixed = true));
    SpringDamper spring(c = 160, d = 1);
    Brake brake(fn_max = 1600, useSupport = true);
    Inertia inertia1(J = 1, phi(start = 0, fixed = true), w(start = 90, fixed = true));
    Fixed fixed;
    Sources.Constant const(k = 1);
    Sources.Step step(startTime = startTime);
    Sources.Step step2(height = -1, offset = 1, startTime = startTime);
    Sources.Sine sine(amplitude = 200, f = 50 / Modelica.Constants.pi);
    Modelica.Blocks.Math.Product product;
  equation
    connect(torque.flange, inertia3.flange_a);
    connect(inertia3.flange_b, clutch.flange_a);
    connect(clutch.flange_b, inertia2.flange_a);
    connect(inertia2.flange_b, spring.flange_a);
    connect(spring.flange_b, brake.flange_a);
    connect(brake.flange_b, inertia1.flange_a);
    connect(sine.y, product.u1);
    connect(step2.y, product.u2);
    connect(product.y, torque.tau);
    connect(const.y, clutch.f_normalized);
    connect(step.y, brake.f_normalized);
    connect(torque.support, fixed.flange);
    connect(brake.support, fixed.flange);
  end Friction;

  model CoupledClutches "Four bodies and three clutches in a row"
    extends Example;
    parameter SI.Frequency f = 0.2 "frequency of clutch1's force";
    parameter SI.Time T2 = 0.4 "when clutch2 is engaged";
    parameter SI.Time T3 = 0.9 "when clutch3 is engaged";
    Inertia J1(J = 1, phi(fixed = true, start = 0), w(start = 10, fixed = true));
    Rotational.Sources.Torque torque(useSupport = true);
    Clutch clutch1(peak = 1.1, fn_max = 20), clutch2(peak = 1.1, fn_max = 20), clutch3(peak = 1.1, fn_max = 20);
    Sources.Sine sin1(amplitude = 10, f = 5);
    Sources.Step step1(startTime = T2), step2(startTime = T3);
    Inertia J2(J = 1, phi(fixed = true), w(fixed = true)), J3(J = 1, phi(fixed = true), w(fixed = true));
    Inertia J4(J = 1, phi(fixed = true), w(fixed = true));
    Sources.Sine sin2(amplitude = 1, f = f, phase = 1.570796326794897);
    Fixed fixed;
  equation
    connect(torque.flange, J1.flange_a);
    connect(J1.flange_b, clutch1.flange_a);
    connect(clutch1.flange_b, J2.flange_a);
    connect(J2.flange_b, clutch2.flange_a);
    connect(clutch2.flange_b, J3.flange_a);
    connect(J3.flange_b, clutch3.flange_a);
    connect(clutch3.flange_b, J4.flange_a);
    connect(sin1.y, torque.tau);
    connect(sin2.y, clutch1.f_normalized);
    connect(step1.y, clutch2.f_normalized);
    connect(step2.y, clutch3.f_normalized);
    connect(fixed.flange, torque.support);
  end CoupledClutches;

  model LossyGearDemo1 "A gear of low efficiency that locks"
    extends Example;
    SI.Power PowerLoss = gear.flange_a.tau * der(gear.flange_a.phi) + gear.flange_b.tau * der(gear.flange_b.phi) "lost in the gear";
    LossyGear gear(ratio = 2, lossTable = [0, 0.5, 0.5, 0, 0], useSupport = true);
    Inertia Inertia1(J = 1);
    Inertia Inertia2(J = 1.5, phi(fixed = true, start = 0), w(fixed = true, start = 0));
    Rotational.Sources.Torque torque1(useSupport = true), torque2(useSupport = true);
    Sources.Sine DriveSine(amplitude = 10, f = 1);
    Sources.Ramp load(height = 5, duration = 2, offset = -10);
    Fixed fixed;
  equation
    connect(Inertia1.flange_b, gear.flange_a);
    connect(gear.flange_b, Inertia2.flange_a);
    connect(torque1.flange, Inertia1.flange_a);
    connect(torque2.flange, Inertia2.flange_b);
    connect(DriveSine.y, torque1.tau);
    connect(load.y, torque2.tau);
    connect(fixed.flange, gear.support);
    connect(fixed.flange, torque1.support);
    connect(fixed.flange, torque2.support);
  end LossyGearDemo1;

  model LossyGearDemo2 "A gear of low efficiency and a bearing with friction on one shaft"
    extends Example;
    LossyGear gear(ratio = 2, lossTable = [0, 0.5, 0.5, 0, 0], useSupport = true);
    Inertia Inertia1(J = 1);
    Inertia Inertia2(J = 1.5, phi(fixed = true, start = 0), w(fixed = true, start = 0));
    Rotational.Sources.Torque torque1(useSupport = true), torque2(useSupport = true);
    Sources.Sine DriveSine(amplitude = 10, f = 1);
    Sources.Ramp load(height = 5, duration = 2, offset = -10);
    BearingFriction bearingFriction(tau_pos = [0, 0.5; 1, 1], useSupport = true);
    Fixed fixed;
  equation
    connect(torque2.flange, Inertia2.flange_b);
    connect(Inertia2.flange_a, gear.flange_b);
    connect(gear.flange_a, Inertia1.flange_b);
    connect(Inertia1.flange_a, bearingFriction.flange_b);
    connect(torque1.flange, bearingFriction.flange_a);
    connect(DriveSine.y, torque1.tau);
    connect(load.y, torque2.tau);
    connect(fixed.flange, gear.support);
    connect(fixed.flange, torque2.support);
    connect(fixed.flange, bearingFriction.support);
    connect(fixed.flange, torque1.support);
  end LossyGearDemo2;

  model LossyGearDemo3 "A gear of very low efficiency with bearing friction"
    extends Example;
    LossyGear gear(ratio = 1, lossTable = [0, 0.25, 0.25, 0.625, 2.5]);
    Inertia Inertia1(w(start = 10), J = 0.001);
    Inertia Inertia2(J = 0.001, phi(fixed = true, start = 0), w(start = 10, fixed = true));
    Rotational.Sources.Torque torque1, torque2;
    Sources.Step step(height = 0);
    Sources.Step step1(height = 1, startTime = 0.5, offset = 0);
  equation
    connect(Inertia1.flange_b, gear.flange_a);
    connect(torque1.flange, Inertia1.flange_a);
    connect(step.y, torque1.tau);
    connect(gear.flange_b, Inertia2.flange_a);
    connect(Inertia2.flange_b, torque2.flange);
    connect(step1.y, torque2.tau);
  end LossyGearDemo3;

  model ElasticBearing "A gear whose housing has inertia and stands on a spring and a damper"
    extends Example;
    Inertia shaft(phi(fixed = true, start = 0), J = 1, w(fixed = true, start = 0));
    Inertia load(J = 50, w(fixed = true, start = 0));
    Spring spring(c = 1e3, phi_rel(fixed = true));
    Fixed fixed;
    SpringDamper springDamper(c = 1e5, d = 5, phi_rel(fixed = true), w_rel(fixed = true));
    Rotational.Sources.Torque torque(useSupport = true);
    Sources.Ramp ramp(duration = 5, height = 100);
    IdealGear idealGear(ratio = 3, useSupport = true);
    Inertia housing(J = 5);
    Rotational.Sensors.MultiSensor multiSensor;
  equation
    connect(torque.flange, shaft.flange_a);
    connect(spring.flange_b, load.flange_a);
    connect(springDamper.flange_a, fixed.flange);
    connect(ramp.y, torque.tau);
    connect(shaft.flange_b, idealGear.flange_a);
    connect(idealGear.flange_b, spring.flange_a);
    connect(idealGear.support, housing.flange_b);
    connect(housing.flange_a, multiSensor.flange_b);
    connect(multiSensor.flange_a, springDamper.flange_b);
    connect(torque.support, fixed.flange);
  end ElasticBearing;

  model Backlash "Three oscillators: without backlash, and with backlash of both kinds"
    extends Example;
    import pi = Modelica.Constants.pi;
    constant SI.Angle angle = pi / 2 "where they start";
    Fixed fixed1, fixed2, fixed3;
    SpringDamper springDamper(c = 20e3, d = 50, phi_nominal = 1);
    ElastoBacklash elastoBacklash(c = 20e3, d = 50, b = pi / 4, phi_nominal = 1);
    ElastoBacklash2 elastoBacklash2(c = 20e3, d = 50, b = 0.78539816339745, phi_nominal = 1);
    Inertia inertia1(J = 5, w(fixed = true, start = 0), phi(fixed = true, start = angle, displayUnit = "deg"));
    Inertia inertia2(J = 5, w(fixed = true, start = 0), phi(fixed = true, start = angle, displayUnit = "deg"));
    Inertia inertia3(J = 5, w(fixed = true, start = 0), phi(fixed = true, start = angle, displayUnit = "deg"));
  equation
    connect(springDamper.flange_b, inertia1.flange_a);
    connect(fixed1.flange, springDamper.flange_a);
    connect(elastoBacklash.flange_b, inertia2.flange_a);
    connect(fixed2.flange, elastoBacklash.flange_a);
    connect(fixed3.flange, elastoBacklash2.flange_a);
    connect(elastoBacklash2.flange_b, inertia3.flange_a);
  end Backlash;

  model RollingWheel "A torque step drives a wheel that rolls, and a mass against a drag"
    extends Example;
    IdealRollingWheel idealRollingWheel(radius = 1);
    Inertia inertia(J = 1, phi(fixed = true, start = 0), w(fixed = true, start = 0));
    Rotational.Sources.TorqueStep torqueStep(stepTorque = 10, offsetTorque = 0, startTime = 0.1, useSupport = false);
    Modelica.Mechanics.Translational.Components.Mass mass(L = 0, m = 1);
    Modelica.Mechanics.Translational.Sources.QuadraticSpeedDependentForce quadraticSpeedDependentForce(
      f_nominal = -10, ForceDirection = false, v_nominal = 5);
  equation
    connect(torqueStep.flange, inertia.flange_a);
    connect(inertia.flange_b, idealRollingWheel.flangeR);
    connect(idealRollingWheel.flangeT, mass.flange_a);
    connect(quadraticSpeedDependentForce.flange, mass.flange_b);
  end RollingWheel;

  model HeatLosses "A drive with one of each part that loses power; all losses are carried off to the air"
    extends Example;
    Rotational.Sources.Torque torque;
    Sources.Sine sine1(amplitude = 20, f = 5), sine2(amplitude = 1, f = 0.2);
    Inertia inertia1(J = 2, phi(fixed = true), w(fixed = true)), inertia2(J = 2, phi(fixed = true), w(fixed = true));
    Inertia inertia3(J = 2, phi(fixed = true), w(fixed = true)), inertia4(J = 2, phi(fixed = true), w(fixed = true));
    Inertia inertia5(J = 2), inertia6(J = 2);
    Damper damper(d = 10, useHeatPort = true);
    Fixed fixed;
    SpringDamper springDamper(c = 1e4, d = 20, useHeatPort = true);
    ElastoBacklash elastoBacklash(c = 1e5, d = 100, b = 0.001, useHeatPort = true);
    BearingFriction bearingFriction(useHeatPort = true);
    Spring spring3(c = 1e4);
    LossyGear lossyGear(ratio = 2, lossTable = [0, 0.8, 0.8, 1, 1; 1, 0.7, 0.7, 2, 2], useHeatPort = true);
    Clutch clutch(fn_max = 10, useHeatPort = true, phi_rel(fixed = true), w_rel(fixed = true));
    Rotational.Components.OneWayClutch oneWayClutch(
      fn_max = 1, useHeatPort = true, phi_rel(fixed = true), w_rel(fixed = true), startForward(fixed = true), stuck(fixed = true));
    Brake brake(fn_max = 2, useHeatPort = true);
    Modelica.Thermal.HeatTransfer.Components.Convection convection;
    Modelica.Thermal.HeatTransfer.Sources.FixedTemperature TAmbient(T = 298.15);
    Sources.Constant const(k = 20);
  equation
    connect(sine1.y, torque.tau);
    connect(torque.flange, inertia1.flange_a);
    connect(inertia1.flange_b, damper.flange_b);
    connect(damper.flange_a, fixed.flange);
    connect(inertia1.flange_b, springDamper.flange_a);
    connect(springDamper.flange_b, inertia2.flange_a);
    connect(inertia2.flange_b, elastoBacklash.flange_a);
    connect(elastoBacklash.flange_b, inertia3.flange_a);
    connect(inertia3.flange_b, bearingFriction.flange_a);
    connect(bearingFriction.flange_b, spring3.flange_a);
    connect(spring3.flange_b, inertia4.flange_a);
    connect(inertia4.flange_b, lossyGear.flange_a);
    connect(lossyGear.flange_b, clutch.flange_a);
    connect(clutch.flange_b, inertia5.flange_a);
    connect(inertia5.flange_b, oneWayClutch.flange_a);
    connect(oneWayClutch.flange_b, inertia6.flange_a);
    connect(inertia6.flange_b, brake.flange_a);
    connect(sine2.y, clutch.f_normalized);
    connect(sine2.y, oneWayClutch.f_normalized);
    connect(sine2.y, brake.f_normalized);
    connect(const.y, convection.Gc);
    connect(convection.fluid, TAmbient.port);
    connect(damper.heatPort, convection.solid);
    connect(springDamper.heatPort, convection.solid);
    connect(elastoBacklash.heatPort, convection.solid);
    connect(bearingFriction.heatPort, convection.solid);
    connect(lossyGear.heatPort, convection.solid);
    connect(clutch.heatPort, convection.solid);
    connect(oneWayClutch.heatPort, convection.solid);
    connect(brake.heatPort, convection.solid);
  end HeatLosses;

  model SimpleGearShift "A planetary set whose ring is freed by a brake and coupled to the sun by a clutch"
    extends Example;
    Rotational.Sources.TorqueStep torqueStep(startTime = 0.5, stepTorque = 20, offsetTorque = 0);
    Inertia engine(J = 1);
    IdealPlanetary idealPlanetary(ratio = 75 / 50);
    Inertia load(J = 10, phi(start = 0, fixed = true), w(start = 0, fixed = true));
    Rotational.Sources.QuadraticSpeedDependentTorque quadraticSpeedDependentTorque(tau_nominal = -20, w_nominal = 10.471975511966);
    Clutch clutch(cgeo = 2, fn_max = 100, phi_rel(start = 0, fixed = true), w_rel(start = 0, fixed = true));
    Brake brake(cgeo = 2, fn_max = 100);
    Sources.Ramp ramp(startTime = 2, height = 1, offset = 0, duration = 0.1);
    Sources.Constant const(k = 1);
    Modelica.Blocks.Math.Feedback feedback;
  equation
    connect(torqueStep.flange, engine.flange_a);
    connect(quadraticSpeedDependentTorque.flange, load.flange_b);
    connect(engine.flange_b, idealPlanetary.sun);
    connect(idealPlanetary.ring, clutch.flange_b);
    connect(idealPlanetary.sun, clutch.flange_a);
    connect(idealPlanetary.ring, brake.flange_a);
    connect(idealPlanetary.carrier, load.flange_a);
    connect(ramp.y, clutch.f_normalized);
    connect(const.y, feedback.u1);
    connect(ramp.y, feedback.u2);
    connect(feedback.y, brake.f_normalized);
  end SimpleGearShift;

  model EddyCurrentBrake "An eddy current brake stops a wheel and heats its own disc"
    extends Example;
    import alpha20 = Modelica.Electrical.Machines.Thermal.Constants.alpha20Copper;
    Rotational.Sources.EddyCurrentTorque eddyCurrentTorque(
      tau_nominal = 100, w_nominal = 10, TRef = 293.15, alpha20(displayUnit = "1/K") = 3.92e-3, useHeatPort = true,
      useExcitationInput = true);
    Inertia inertia(J = 1, phi(fixed = true, start = 0), w(fixed = true, start = 20));
    Modelica.Thermal.HeatTransfer.Components.HeatCapacitor heatCapacitor(C = 1, T(fixed = true, start = 293.15));
    Sources.Ramp ramp(height = 1, duration = 0.1, startTime = 0.1);
  equation
    connect(eddyCurrentTorque.flange, inertia.flange_a);
    connect(eddyCurrentTorque.heatPort, heatCapacitor.port);
    connect(ramp.y, eddyCurrentTorque.excitation);
  end EddyCurrentBrake;

  model OneWayClutch "A one-way clutch between two bodies that is engaged in pulses"
    extends Example;
    Inertia inertiaIn(J = 1, phi(start = 0, fixed = true), w(start = -0.5, fixed = true));
    Inertia inertiaOut(J = 1, phi(start = 0, fixed = true), w(start = 0, fixed = true));
    Rotational.Components.OneWayClutch oneWayClutch(peak = 25, fn_max = 3, startForward(fixed = true), stuck(fixed = true));
    Rotational.Sources.Torque torque;
    Sources.Sine sine(amplitude = 10, f = 3);
    Sources.Pulse pulse(period = 1.3, startTime = 0.3, width = 50);
  equation
    connect(torque.flange, inertiaIn.flange_a);
    connect(inertiaIn.flange_b, oneWayClutch.flange_a);
    connect(oneWayClutch.flange_b, inertiaOut.flange_a);
    connect(sine.y, torque.tau);
    connect(pulse.y, oneWayClutch.f_normalized);
  end OneWayClutch;

  model OneWayClutchDisengaged "A one-way clutch that works as a freewheel only, with a load on the driven body"
    extends Example;
    Inertia inertiaIn(J = 1, phi(start = 0, fixed = true), w(start = -0.5, fixed = true));
    Inertia inertiaOut(J = 1, phi(start = 0, fixed = true), w(start = 0, fixed = true));
    Rotational.Components.OneWayClutch oneWayClutch(peak = 25, fn_max = 3, startForward(fixed = true), stuck(fixed = true));
    Rotational.Sources.Torque torque;
    Rotational.Sources.ConstantTorque torqueLoad(tau_constant = -0.3);
    Sources.Sine sine(amplitude = 10, f = 2, offset = 0.3);
    Sources.Constant const(k = 0);
  equation
    connect(torque.flange, inertiaIn.flange_a);
    connect(inertiaIn.flange_b, oneWayClutch.flange_a);
    connect(oneWayClutch.flange_b, inertiaOut.flange_a);
    connect(inertiaOut.flange_b, torqueLoad.flange);
    connect(sine.y, torque.tau);
    connect(const.y, oneWayClutch.f_normalized);
  end OneWayClutchDisengaged;

  model CompareBrakingTorque "Four inertias braked by a constant torque, and by torques linear, quadratic and inverse in speed"
    extends Example;
    parameter SI.Inertia J = 1 "moment of inertia";
    parameter SI.AngularVelocity w_start = 100 "speed at the start";
    parameter SI.Torque tau_nominal = 100 "nominal torque";
    parameter SI.AngularVelocity w_nominal = abs(w_start) "nominal speed";
    parameter SI.AngularVelocity w0 = 1 "speed below which torques are smaller";
    Inertia inertia1(J = J, phi(fixed = true), w(fixed = true, start = w_start));
    Inertia inertia2(J = J, phi(fixed = true), w(fixed = true, start = w_start));
    Inertia inertia3(J = J, phi(fixed = true), w(fixed = true, start = w_start));
    Inertia inertia4(J = J, phi(fixed = true), w(fixed = true, start = w_start));
    Rotational.Sources.SignTorque signTorque(
      tau_nominal = -tau_nominal, reg = Modelica.Blocks.Types.Regularization.Linear, w0 = w0);
    Rotational.Sources.LinearSpeedDependentTorque linearSpeedDependentTorque(
      tau_nominal = -tau_nominal, w_nominal = w_nominal, TorqueDirection = false);
    Rotational.Sources.QuadraticSpeedDependentTorque quadraticSpeedDependentTorque(
      tau_nominal = -tau_nominal, w_nominal = w_nominal, TorqueDirection = false);
    Rotational.Sources.InverseSpeedDependentTorque inverseSpeedDependentTorque(
      tau_nominal = -tau_nominal, w_nominal = w_nominal, w0 = w0, TorqueDirection = false);
  equation
    connect(signTorque.flange, inertia1.flange_a);
    connect(linearSpeedDependentTorque.flange, inertia2.flange_a);
    connect(quadraticSpeedDependentTorque.flange, inertia3.flange_a);
    connect(inverseSpeedDependentTorque.flange, inertia4.flange_a);
  end CompareBrakingTorque;

  package Blocks "Rotational parts with signals as their interfaces"
    model DirectInertia "An inertia that torques drive; its motion is its output"
      parameter SI.Inertia J(min = 0) = 1;
      Modelica.Blocks.Interfaces.RealInput tauDrive(unit = "N.m"), tau(unit = "N.m");
      Modelica.Blocks.Interfaces.RealOutput phi(unit = "rad"), w(unit = "rad/s"), a(unit = "rad/s2");
      Inertia inertia(J = J, phi(start = 0, fixed = true), w(start = 0, fixed = true));
      Rotational.Sources.Torque torqueSource;
      TorqueToAngleAdaptor torqueToAngle;
    equation
      connect(tauDrive, torqueSource.tau);
      connect(torqueSource.flange, inertia.flange_a);
      connect(inertia.flange_b, torqueToAngle.flange);
      connect(torqueToAngle.phi, phi);
      connect(torqueToAngle.w, w);
      connect(torqueToAngle.a, a);
      connect(torqueToAngle.tau, tau);
    end DirectInertia;

    model InverseInertia "An inertia that a motion drives; the torque that this takes is its output"
      parameter SI.Inertia J = 1;
      Modelica.Blocks.Interfaces.RealInput phi(unit = "rad"), w(unit = "rad/s"), a(unit = "rad/s2");
      Modelica.Blocks.Interfaces.RealOutput tau(unit = "N.m");
      Inertia inertia(J = J);
      AngleToTorqueAdaptor angleToTorque;
    equation
      connect(angleToTorque.flange, inertia.flange_a);
      connect(phi, angleToTorque.phi);
      connect(w, angleToTorque.w);
      connect(a, angleToTorque.a);
      connect(tau, angleToTorque.tau);
    end InverseInertia;

    model ForceElement "A spring, with a damper if the speeds are given, too"
      parameter Boolean use_w = true;
      parameter SI.RotationalSpringConstant c = 1e4;
      parameter SI.RotationalDampingConstant d = 0;
      Modelica.Blocks.Interfaces.RealInput phi1(unit = "rad"), phi2(unit = "rad"), w1(unit = "rad/s"), w2(unit = "rad/s");
      Modelica.Blocks.Interfaces.RealOutput tau1(unit = "N.m"), tau2(unit = "N.m");
      AngleToTorqueAdaptor angleToTorque1(use_w = use_w, use_a = false), angleToTorque2(use_w = use_w, use_a = false);
      SpringDamper springDamper(c = c, d = d) if use_w;
      Spring spring(c = c) if not use_w;
    equation
      connect(angleToTorque1.flange, springDamper.flange_a);
      connect(angleToTorque2.flange, springDamper.flange_b);
      connect(angleToTorque1.flange, spring.flange_a);
      connect(angleToTorque2.flange, spring.flange_b);
      connect(phi1, angleToTorque1.phi);
      connect(phi2, angleToTorque2.phi);
      connect(w1, angleToTorque1.w);
      connect(w2, angleToTorque2.w);
      connect(tau1, angleToTorque1.tau);
      connect(tau2, angleToTorque2.tau);
    end ForceElement;
  end Blocks;

  model GenerationOfFMUs "Parts that exchange signals as exported ones would"
    extends Example;
    Sources.Sine sine1(f = 2, amplitude = 10);
    Blocks.DirectInertia directInertia(J = 1.1);
    Blocks.InverseInertia inverseInertia(J = 2.2);
    Blocks.ForceElement springDamper(c = 1e4, d = 100);
    Inertia inertia2a(J = 1.1, phi(fixed = true, start = 0), w(fixed = true, start = 0));
    Inertia inertia2b(J = 2.2, phi(fixed = true, start = 0), w(fixed = true, start = 0));
    Rotational.Sources.Torque torque2, force3;
    TorqueToAngleAdaptor torqueToAngle2a(use_a = false), torqueToAngle2b(use_a = false);
    Blocks.ForceElement spring(c = 1e4, use_w = false);
    Inertia inertia3a(J = 1.1, phi(fixed = true, start = 0), w(fixed = true, start = 0));
    Inertia inertia3b(J = 2.2, phi(fixed = true, start = 0), w(fixed = true, start = 0));
    TorqueToAngleAdaptor torqueToAngle3a(use_w = false, use_a = false), torqueToAngle3b(use_w = false, use_a = false);
  equation
    connect(sine1.y, directInertia.tauDrive);
    connect(directInertia.phi, inverseInertia.phi);
    connect(directInertia.w, inverseInertia.w);
    connect(directInertia.a, inverseInertia.a);
    connect(inverseInertia.tau, directInertia.tau);
    connect(sine1.y, torque2.tau);
    connect(sine1.y, force3.tau);
    connect(torque2.flange, inertia2a.flange_a);
    connect(inertia2a.flange_b, torqueToAngle2a.flange);
    connect(torqueToAngle2b.flange, inertia2b.flange_a);
    connect(torqueToAngle2a.phi, springDamper.phi1);
    connect(torqueToAngle2a.w, springDamper.w1);
    connect(torqueToAngle2a.tau, springDamper.tau1);
    connect(torqueToAngle2b.phi, springDamper.phi2);
    connect(torqueToAngle2b.w, springDamper.w2);
    connect(torqueToAngle2b.tau, springDamper.tau2);
    connect(force3.flange, inertia3a.flange_a);
    connect(inertia3a.flange_b, torqueToAngle3a.flange);
    connect(torqueToAngle3b.flange, inertia3b.flange_a);
    connect(torqueToAngle3a.phi, spring.phi1);
    connect(torqueToAngle3a.w, spring.w1);
    connect(torqueToAngle3a.tau, spring.tau1);
    connect(torqueToAngle3b.phi, spring.phi2);
    connect(torqueToAngle3b.w, spring.w2);
    connect(torqueToAngle3b.tau, spring.tau2);
  end GenerationOfFMUs;
end RotationalExamples;
