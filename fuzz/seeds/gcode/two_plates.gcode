; two parts on one table, each with its own zero, fed by an extruder on A
G21 G90
G10 L2 P1 X0 Y0 Z0
G10 L2 P2 X200 Y50 Z0
M221 S50 T0
G54
G92 A0
G0 X0 Y0 Z2
G1 X100 A40 F600
G55
G0 X0 Y0
G1 X100 A80
