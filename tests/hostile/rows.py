"""Ways to spoil the arm of `case` by one change, and what is right then.

Each line: what is wrong | what stands in the arm | what stands there instead | outcome | word of the message or note.
"""

from __future__ import annotations

ROWS = r"""
# numbers
too few numbers | xyz="0 0 0.3" | xyz="0 0.3" | ModelError | 3 finite numbers
too many numbers | xyz="0 1 0" | xyz="0 1 0 0" | ModelError | 3 finite
axis with commas | xyz="0 1 0" | xyz="0,1,0" | ModelError | repair="comma"
mass without value | value="2.5" |  | ModelError | value is missing
negative zero | xyz="0 0 0.3" | xyz="-0.0 -0 0.3" | sound |
subnormal length | xyz="0 0 0.3" | xyz="4e-324 0 0.3" | sound |
number in capitals | value="2.5" | value="+25.E-1" | sound |
# inertia
negative mass | value="2.5" | value="-2.5" | ModelError | is negative
no mass | <mass value="2.5"/> |  | ModelError | has no <mass>
two masses | <mass value="2.5"/> | <mass value="2.5"/><mass value="2.5"/> | ModelError | 2 <mass>
half an inertia | iyy="0.05" |  | ModelError | iyy is missing
negative moment | izz="0.013" | izz="-0.013" | ModelError | negative principal
indefinite tensor | ixy="0.001" | ixy="1" | ModelError | semi-definite
triangle inequality | ixx="0.04" | ixx="0.4" | sound | no rigid body
slight violation | ixx="0.04" | ixx="0.072" | sound | no rigid body
mass 1e300 | value="2.5" | value="1e300" | ModelError | 1e300
light far mass | value="1.5" | value="1e-5" | sound |
# axes, limits, origins
zero axis | <axis xyz="0 1 0"/> | <axis xyz="0 0 0"/> | ModelError | no direction
tiny axis | <axis xyz="0 1 0"/> | <axis xyz="0 1e-300 0"/> | ModelError | no direction
huge axis | <axis xyz="0 1 0"/> | <axis xyz="0 1e30 0"/> | ModelError | no direction
axis of length 2 | <axis xyz="0 1 0"/> | <axis xyz="0 2 0"/> | sound |
no axis | <axis xyz="0 1 0"/> |  | sound |
empty axis | <axis xyz="0 1 0"/> | <axis/> | ModelError | xyz is missing
two axes | <axis xyz="0 1 0"/> | <axis xyz="0 1 0"/><axis xyz="0 1 0"/> | ModelError | 2 <axis>
equal limits | lower="-1.5" | lower="2" | sound | equals the upper one
inverted limits | lower="-1.5" | lower="5" | ModelError | above.*repair="limit-order"
infinite limit | upper="2" | upper="inf" | ModelError | upper.*repair="no-limit"
largest double | upper="2" | upper="1.7976931348623157e308" | ModelError | no-limit
limit of SDF | upper="2" | upper="1e16" | sound | not given at 'shoulder'
limit out of reach | lower="-1.5" upper="2" | lower="1e5" upper="1e6" | ModelError | between
limits without zero | lower="-1.5" | lower="1.9" | sound |
negative effort | effort="30" | effort="-30" | ModelError | is negative
negative velocity | velocity="4" | velocity="-4" | ModelError | is negative
zero effort | effort="30" | effort="0" | sound | effort limit is 0
infinite effort | effort="30" | effort="inf" | ModelError | no-limit
velocity with a unit | velocity="4" | velocity="4 rad/s" | ModelError | <limit> velocity
friction in words | friction="0.1" | friction="x" | ModelError | <dynamics> friction
letter in an angle | rpy="0 0 0.5" | rpy="0 0 a" | ModelError | joint 'shoulder': <origin> rpy
negative damping | damping="0.3" | damping="-0.3" | ModelError | is negative
huge damping | damping="0.3" | damping="1e30" | sound |
degrees as rad | rpy="0 0 0.5" | rpy="0 0 360" | sound |
angle of 1e30 | rpy="0 0 0.5" | rpy="0 0 1e30" | ModelError | too large
two origins | <origin xyz="0 0 0.4"/> | <origin xyz="0 0 0.4"/><origin xyz="0 0 0.4"/> | ModelError | 2 <origin>
no type | type="revolute" |  | ModelError | joint 'shoulder' needs the attribute type
kind in capitals | type="revolute" | type="Revolute" | ModelError | unknown type 'Revolute'; did you mean 'revolute'
short gravity | <robot name="arm"> | <robot><rbimpedance><gravity xyz="0"/></rbimpedance> | ModelError | <gravity> xyz
mimic alone | <parent link="upper"/> | <parent link="upper"/><mimic/> | ModelError | <mimic> needs the attribute j
mimic with a comma | velocity="1"/> | velocity="1"/><mimic joint="shoulder" offset="1,0"/> | ModelError | <mimic> offset
# names and structure
two links of one name | <link name="tool"/> | <link name="hand"/> | ModelError | two links
two joints of one name | name="mount" | name="slide" | ModelError | two joints
link and joint of one name | name="mount" | name="tool" | sound |
joint universe | name="mount" | name="universe" | ModelError | reserved
movable joint universe | name="slide" | name="universe" | ModelError | reserved
joint root_joint | name="slide" | name="root_joint" | sound |
fixed joint root_joint | name="mount" | name="root_joint" | sound |
no joint name | name="mount" |  | ModelError | needs the attribute name
empty link name | link name="base" | link name="" | ModelError | needs the attribute name
blank joint name | name="mount" | name="  " | ModelError | needs the attribute name
name with a line end | name="mount" | name="mo&#10;unt" | ModelError | control characters
name with an escape | name="mount" | name="&#x9b;31m" | ModelError | x9b31m
name right to left | name="mount" | name="&#x202e;x" | ModelError | control characters
robot name with an escape | name="arm" | name="&#x9b;31m" | ModelError | <robot> name
name with a space | name="slide" | name="the slide" | sound |
name in other letters | name="slide" | name="滑动 ☃ é" | sound |
no robot name | <robot name="arm"> | <robot> | sound |
space around a reference | parent link="hand" | parent link=" hand" | ModelError | repair="name"
unknown parent | parent link="hand" | parent link="hnad" | ModelError | did you mean 'hand'
unknown child | child link="tool" | child link="tol" | ModelError | did you mean 'tool'
no parent | <parent link="hand"/> |  | ModelError | has no <parent>
two parents elements | <parent link="hand"/> | <parent link="hand"/><parent link="hand"/> | ModelError | 2 <parent>
parent without link | <parent link="hand"/> | <parent/> | ModelError | needs the attribute link
self-parent | parent link="hand" | parent link="tool" | ModelError | joint 'mount' joins link 'tool' to itself
cycle | parent link="base" | parent link="hand" | ModelError | circle
island | </robot> | <link name="island"/></robot> | ModelError | 'base', 'island'
default namespace | <robot  | <robot xmlns="http://a"  | ModelError | is no URDF
# markup
processing instructions | <robot  | <?php system('x')?><?xml-stylesheet href='a'?><robot  | sound |
inclusion | </robot> | <xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="/etc/passwd"/></robot> | sound |
xacro macro left | </robot> | <xacro:arm/></robot> | ModelError | xacro.*expanded
"""
