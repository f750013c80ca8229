"""Planar discrete elastic rods: numbers in, numbers out; no robot, no clock.

symbol         name             unit    what it is, and the chapter's equation
q              q                m       coordinates of all nodes (13.1)
v              v                m/s     their velocities
e              ex, ey           m       edge vector
|e|, l         length, l        m       length of an edge, its natural length
u              ux, uy           1/m     e/|e|^2; grad theta = (-u_y, u_x)
theta          theta            rad     direction of an edge
T              T                N       tension EA (|e|/l - 1), from (13.2)
phi            phi              rad     angle of a hinge, from its first edge to its second (13.4)
psi            psi              rad     opening angle of a hub hinge, Fig. 13.4b
t              t                1       tan(phi/2)
kappa          kappa            1/m     curvature 2 t/dl of a hinge (13.3)
kappa_bar      kappa_bar        1/m     natural curvature
delta_psi      delta_psi        rad     rotation of a limb by its actuator, Fig. 13.5b
dl             dl               m       Voronoi length
E, A, I        EA, EI           N, N m2 Young's modulus, area, second moment of area
C_d            c                kg/m    drag 1/2 rho_f C_d D dl of a node (13.8)
M              m, mass          kg      lumped masses
h, gamma       h, gamma         s       time step; coefficient of a stage times h
Phi            phi, energy      J       incremental potential of a stage, see potential.py
"""
