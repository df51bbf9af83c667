"""Text of the file that `linkwork new linkage` writes: a four-bar linkage with every table explained."""

from __future__ import annotations

TEXT = """\
# Your own linkage: linkwork linkage {file}
#
#                C
#               / \\
#              /   \\  rocker
#   coupler   /     \\          Bodies that have a point of the same name are pinned to each other there:
#            /       \\         the crank and the coupler at B, the coupler and the rocker at C.
#       B   /         \\
#   crank \\/           \\
#         A             D      ground
#
# Every quantity is a number in SI or a text with its unit, such as "50 mm" or "300 rpm". The whole number 0 stands for
# a coordinate that is always zero; every other number becomes a parameter that a run, a chart or an FMU can change.
title = "A four-bar linkage"

[linkage]
name = "my-linkage"                       # letters, digits, hyphens
source = "proportions chosen here"        # where the numbers are from
gravity = "9.81 m/s^2"                    # left out: none; gravity_direction = "-90 deg"
# loads = ["P"]                           # points on which forces act: inputs P.load_x, P.load_y; in the axes of the body
#                                         # instead of the ground: {{ point = "P", frame = "body" }}
# torques = ["rocker"]                    # bodies on which a torque acts: input rocker.torque

[linkage.ground]                          # points of the ground, [x, y]
A = [0, 0]
D = ["150 mm", 0]

[linkage.bodies.crank]
bar = ["A", "B"]                          # a bar from A, its origin, to B on its x axis
length = "50 mm"
section = {{ kind = "bar", width = "20 mm", thickness = "5 mm", material = "steel" }}

[linkage.bodies.coupler]
bar = ["B", "C"]
length = "150 mm"
points = {{ P = ["75 mm", "60 mm"] }}       # further points in the body's own axes
mass = "0.4 kg"                           # instead of a section
cog = ["75 mm", "20 mm"]                  # centre of mass; left out: the middle of the bar
inertia = "1.2e-3 kg*m^2"                 # about the centre of mass

[linkage.bodies.rocker]
bar = ["D", "C"]
length = "120 mm"
section = {{ kind = "rod", diameter = "12 mm", material = "aluminium" }}

# [linkage.slides.G]                      # a body that slides on another without turning against it
# body = "block"                          # its origin is on the line, its x axis along it
# on = "ground"
# through = "D"                           # a point of that body on the line
# direction = "0 deg"

# [linkage.slots.S]                       # a pin in a straight slot of another body
# pin = "P"
# on = "lever"
# through = "E"
# direction = "0 deg"

# [linkage.gears.Z]                       # two bodies, each pinned to the same third
# bodies = ["crank", "wheel"]
# ratio = -0.5                            # speed of the second over speed of the first; negative for external gears
# phase = "0 deg"                         # angle of the second at which that of the first is zero

# [linkage.racks.R]                       # a toothed rack that slides on a body to which its gear is pinned
# gear = "crank"
# rack = "block"
# radius = "20 mm"                        # travel per radian of the gear: positive if the rack is on the right of the gear
# offset = "0 mm"                         # position of the slide at which the angle of the gear is zero

[linkage.springs.return]                  # about a pin, along a slide, or between = ["P", "D"]
at = "D"
stiffness = "0.5 N*m/rad"
free = "90 deg"                           # angle, position or length at which it is free
damping = "0.01 N*m*s/rad"
# friction = "0.1 N*m"                    # Coulomb friction, smooth about rest
# law = "3*x**3"                          # a further force against the stretch x and its rate v, positive where it resists
#                                         # as 3*x and 2*v do (a motor at a pin is 2*v - 5), or a table of rows
#                                         # such as ["5 deg", "2 N*m"]
# constants = {{ a = "3 N*m" }}             # of a law such as "a*x**3": parameters
# driven = true                           # an input drives it: a cylinder, a linear motor

# [linkage.friction]                      # friction that grows with the force in a joint
# B = "0.2 mm"                            # for a pin: the friction radius, coefficient times radius of the pin
# G = 0.1                                 # for a slide or a slot: the coefficient

[linkage.freedoms]                        # all freedoms of the linkage; left out: they are chosen automatically
crank = {{ joint = "A", speed = "300 rpm" }} # start = "0 deg"; driven = true: its rate can be commanded

[linkage.assembly]                        # +1 or -1: on which side a pair of bodies is joined
C = 1

# The rest is a case as for any mechanism: initial, drive, run.
[run]
revolutions = 2.0
"""
