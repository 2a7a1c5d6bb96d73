; KISSlicer - FREE
; Windows
; version 1.6.3
; Built: Mar  5 2018, 10:00:00
;
; *** Printer Settings ***
;
; printer_name = sample
; num_extruders = 1
; firmware_type = 1
; add_comments = 1
; nozzle_dia_1 = 0.4
;
; *** Material Settings for Extruder 1 ***
;
; material_name = PLA
; g_code_matl = NULL
; > Decoded
; flowrate_tweak = 1
; fiber_dia_mm = 1.75
;
; *** Style Settings ***
;
; layer_thickness_mm = 0.2
; max_layer_thickness_mm = 0
; first_layer_thickness_mm = 0
; extrusion_width_mm = 0.45
;
; *** G-code Prefix ***
;
; [mm] mode
G21
G90
M83
M140 S60
G28
;
; *** Main G-code ***
;
; BEGIN_LAYER_OBJECT z=0.200 z_thickness=0.200
;
; *** Selecting and Warming Extruder 1 to 195 C ***
T0
M104 S195
M109 S195
;
; 'Perimeter Path', 0.6 [feed mm/s], 30.0 [head mm/s]
G1 X0 Y0 Z0.3 E0 F9000
G1 X0 Y0 Z0.2 E0 F300
G1 X20 Y0 E0.67698 F1800
G1 X20 Y20 E0.67698 F1800
G1 X0 Y20 E0.67698 F1800
G1 X0 Y0 E0.67698 F1800
;
; 'Destring/Wipe/Jump Path', 0.0 [feed mm/s], 20.0 [head mm/s]
G1 E-1 F900
G1 X2 Y2 F9000
;
; 'Solid Path', 0.6 [feed mm/s], 30.0 [head mm/s]
; 'Destring Prime'
G1 E1 F900
G1 X18 Y2 E0.54158 F1800
G1 X18 Y18 E0.54158 F1800
G1 X2 Y18 E0.54158 F1800
G1 X2 Y2 E0.54158 F1800
;
; END_LAYER_OBJECT z=0.200
; BEGIN_LAYER_OBJECT z=0.400 z_thickness=0.200
; 'Perimeter Path', 0.6 [feed mm/s], 30.0 [head mm/s]
G1 X0 Y0 Z0.5 E0 F9000
G1 X0 Y0 Z0.4 E0 F300
G1 X20 Y0 E0.67698 F1800
G1 X20 Y20 E0.67698 F1800
G1 X0 Y20 E0.67698 F1800
G1 X0 Y0 E0.67698 F1800
;
; END_LAYER_OBJECT z=0.400
; *** G-code Postfix ***
M104 S0
M84
