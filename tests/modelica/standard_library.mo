package Modelica "Classes of the Modelica Standard Library 4.1.0 by name, written anew from their equations, as far as tests need them"
  package Mechanics
    package Rotational
      package Interfaces
        connector Flange_a
          Real phi(unit = "rad");
          flow Real tau(unit = "N.m");
        end Flange_a;
        connector Flange_b
          Real phi(unit = "rad");
          flow Real tau(unit = "N.m");
        end Flange_b;
        connector Support
          Real phi(unit = "rad");
          flow Real tau(unit = "N.m");
        end Support;
        partial model PartialTwoFlanges
          Flange_a flange_a;
          Flange_b flange_b;
        end PartialTwoFlanges;
        partial model PartialCompliant
          extends PartialTwoFlanges;
          Real phi_rel(start = 0, unit = "rad");
          Real tau(unit = "N.m");
        equation
          phi_rel = flange_b.phi - flange_a.phi;
          flange_b.tau = tau;
          flange_a.tau = -tau;
        end PartialCompliant;
        partial model PartialCompliantWithRelativeStates
          extends PartialCompliant;
          Real w_rel(start = 0, unit = "rad/s");
        equation
          w_rel = der(phi_rel);
        end PartialCompliantWithRelativeStates;
        model InternalSupport
          Real phi(unit = "rad");
          Real tau(unit = "N.m");
          Flange_a flange;
        equation
          flange.phi = phi;
          flange.tau = tau;
        end InternalSupport;
        partial model PartialSupported "With a support, or on the ground"
          parameter Boolean useSupport = false;
          Support support if useSupport;
          InternalSupport internal;
          Components.Fixed ground if not useSupport;
        equation
          connect(internal.flange, support);
          connect(internal.flange, ground.flange);
        end PartialSupported;
      end Interfaces;
      package Components
        model Fixed
          parameter Real phi0(unit = "rad") = 0;
          Interfaces.Flange_b flange;
        equation
          flange.phi = phi0;
        end Fixed;
        model Inertia
          extends Interfaces.PartialTwoFlanges;
          parameter Real J(min = 0, unit = "kg.m2");
          Real phi(start = 0, unit = "rad");
          Real w(start = 0, unit = "rad/s");
          Real a(start = 0, unit = "rad/s2");
        equation
          phi = flange_a.phi;
          phi = flange_b.phi;
          w = der(phi);
          a = der(w);
          J * a = flange_a.tau + flange_b.tau;
        end Inertia;
        model Spring
          extends Interfaces.PartialCompliant;
          parameter Real c(min = 0, unit = "N.m/rad");
          parameter Real phi_rel0(unit = "rad") = 0;
        equation
          tau = c * (phi_rel - phi_rel0);
        end Spring;
        model Damper
          extends Interfaces.PartialCompliantWithRelativeStates;
          parameter Real d(min = 0, unit = "N.m.s/rad");
        equation
          tau = d * w_rel;
        end Damper;
        model SpringDamper
          extends Interfaces.PartialCompliantWithRelativeStates;
          parameter Real c(min = 0, unit = "N.m/rad");
          parameter Real d(min = 0, unit = "N.m.s/rad");
          parameter Real phi_rel0(unit = "rad") = 0;
        equation
          tau = c * (phi_rel - phi_rel0) + d * w_rel;
        end SpringDamper;
        model IdealGear
          extends Interfaces.PartialTwoFlanges;
          extends Interfaces.PartialSupported;
          parameter Real ratio;
        equation
          flange_a.phi - internal.phi = ratio * (flange_b.phi - internal.phi);
          ratio * flange_a.tau + flange_b.tau = 0;
          internal.tau + flange_a.tau + flange_b.tau = 0;
        end IdealGear;
        model IdealPlanetary
          parameter Real ratio;
          Interfaces.Flange_a sun;
          Interfaces.Flange_a carrier;
          Interfaces.Flange_b ring;
        equation
          (1 + ratio) * carrier.phi = sun.phi + ratio * ring.phi;
          ring.tau = ratio * sun.tau;
          carrier.tau = -(1 + ratio) * sun.tau;
        end IdealPlanetary;
        model IdealRollingWheel
          parameter Real radius(unit = "m");
          Interfaces.Flange_a flangeR;
          Translational.Interfaces.Flange_b flangeT;
        equation
          flangeR.phi * radius = flangeT.s;
          radius * flangeT.f + flangeR.tau = 0;
        end IdealRollingWheel;
      end Components;
      package Sources
        partial model PartialTorque
          extends Interfaces.PartialSupported;
          Interfaces.Flange_b flange;
          Real phi(unit = "rad");
        equation
          phi = flange.phi - internal.phi;
          internal.tau + flange.tau = 0;
        end PartialTorque;
        model Torque
          extends PartialTorque;
          input Real tau(unit = "N.m");
        equation
          flange.tau = -tau;
        end Torque;
        model TorqueStep
          extends PartialTorque;
          parameter Real stepTorque(unit = "N.m");
          parameter Real offsetTorque(unit = "N.m") = 0;
          parameter Real startTime(unit = "s") = 0;
        equation
          flange.tau = -(offsetTorque + (if time < startTime then 0 else stepTorque));
        end TorqueStep;
        model QuadraticSpeedDependentTorque
          extends PartialTorque;
          parameter Real tau_nominal(unit = "N.m");
          parameter Boolean TorqueDirection = true;
          parameter Real w_nominal(unit = "rad/s");
          Real w(unit = "rad/s");
          Real tau(unit = "N.m");
        equation
          w = der(phi);
          tau = -flange.tau;
          tau = if TorqueDirection then tau_nominal * (w / w_nominal) ^ 2 else
            tau_nominal * smooth(1, if w >= 0 then (w / w_nominal) ^ 2 else -(w / w_nominal) ^ 2);
        end QuadraticSpeedDependentTorque;
      end Sources;
      package Sensors
        model SpeedSensor
          Interfaces.Flange_a flange;
          output Real w(unit = "rad/s");
        equation
          w = der(flange.phi);
          flange.tau = 0;
        end SpeedSensor;
      end Sensors;
    end Rotational;
    package Translational
      package Interfaces
        connector Flange_a
          Real s(unit = "m");
          flow Real f(unit = "N");
        end Flange_a;
        connector Flange_b
          Real s(unit = "m");
          flow Real f(unit = "N");
        end Flange_b;
      end Interfaces;
      package Components
        model Mass
          parameter Real m(min = 0, unit = "kg");
          parameter Real L(unit = "m") = 0;
          Interfaces.Flange_a flange_a;
          Interfaces.Flange_b flange_b;
          Real s(start = 0, unit = "m");
          Real v(start = 0, unit = "m/s");
        equation
          flange_a.s = s - L / 2;
          flange_b.s = s + L / 2;
          v = der(s);
          m * der(v) = flange_a.f + flange_b.f;
        end Mass;
      end Components;
      package Sources
        model QuadraticSpeedDependentForce
          parameter Real f_nominal(unit = "N");
          parameter Boolean ForceDirection = true;
          parameter Real v_nominal(unit = "m/s");
          Interfaces.Flange_b flange;
          Real v(unit = "m/s");
        equation
          v = der(flange.s);
          -flange.f = if ForceDirection then f_nominal * (v / v_nominal) ^ 2 else
            f_nominal * smooth(1, if v >= 0 then (v / v_nominal) ^ 2 else -(v / v_nominal) ^ 2);
        end QuadraticSpeedDependentForce;
      end Sources;
    end Translational;
  end Mechanics;
  package Blocks
    package Math
      model Gain
        parameter Real k;
        input Real u;
        output Real y;
      equation
        y = k * u;
      end Gain;
      model Feedback
        input Real u1;
        input Real u2;
        output Real y;
      equation
        y = u1 - u2;
      end Feedback;
    end Math;
    package Continuous
      model FirstOrder
        parameter Real k = 1;
        parameter Real T;
        parameter Real y_start = 0;
        input Real u;
        output Real y(start = y_start, fixed = true);
      equation
        T * der(y) = k * u - y;
      end FirstOrder;
      model PI
        parameter Real k = 1;
        parameter Real T;
        parameter Real x_start = 0;
        input Real u;
        output Real y;
        Real x(start = x_start, fixed = true);
      equation
        der(x) = u / T;
        y = k * (x + u);
      end PI;
    end Continuous;
    package Logical
      model Switch
        input Real u1;
        input Boolean u2;
        input Real u3;
        output Real y;
      equation
        y = if u2 then u1 else u3;
      end Switch;
    end Logical;
    package Sources
      model RealExpression
        output Real y;
      end RealExpression;
      model BooleanExpression
        output Boolean y;
      end BooleanExpression;
      model Step
        parameter Real height = 1;
        parameter Real offset = 0;
        parameter Real startTime = 0;
        output Real y;
      equation
        y = offset + (if time < startTime then 0 else height);
      end Step;
    end Sources;
  end Blocks;
end Modelica;
