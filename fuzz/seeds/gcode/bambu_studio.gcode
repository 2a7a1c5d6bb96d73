; HEADER_BLOCK_START
; BambuStudio 01.08.00.62
; model printing time: 1m 2s; total estimated time: 8m 2s
; total layer number: 2
; filament_density: 1.26
; filament_diameter: 1.75
; max_z_height: 0.40
; HEADER_BLOCK_END

; CONFIG_BLOCK_START
; gcode_flavor = marlin
; layer_height = 0.2
; initial_layer_print_height = 0.2
; line_width = 0.42
; nozzle_diameter = 0.4
; printer_model = Bambu Lab A1
; single_extruder_multi_material = 1
; CONFIG_BLOCK_END

; EXECUTABLE_BLOCK_START
M73 P0 R8
M201 X12000 Y12000 Z1500 E5000
M203 X500 Y500 Z30 E30
M204 P12000 R5000 T12000
M205 X9.00 Y9.00 Z3.00 E3.00
M106 S0
; FEATURE: Custom
;===== machine: A1 =========================
G392 S0
M9833.2
;M400
M1002 gcode_claim_action : 2
M1002 set_filament_type:PLA
M104 S140
M140 S65
;=====start printer sound ===================
M17
M400 S1
M1006 S1
M1006 A0 B10 L100 C37 D10 M60 E37 F10 N60
M1006 W
;=====avoid end stop =================
G91
G380 S2 Z40 F1200
G380 S3 Z-15 F1200
G90
M412 S1
M620 M ;enable remap
M620 S0A   ; switch material if AMS exist
    M1002 gcode_claim_action : 4
    M400
    M109 S250
    T0
    G92 E0
    M620.10 A0 F74.8347
    M620.1 E F299.339 T240
    M400
M621 S0A
M622 J0
    M1002 judge_flag extrude_cali_flag
M623
G29.1 Z0 ; clear z-trim value first
G29.2 S1
M1002 gcode_claim_action : 1
G29 A1 X0 Y0 I20 J20
M975 S1 ; turn on mech mode suppression
M970.3 Q1 A5 K0 O1
M974 Q1 S2 P0
G150.3
G39.4
M211 X0 Y0 Z0
M1007 S1
G29.4
; MACHINE_START_GCODE_END
; filament start gcode
M106 P3 S150
M142 P1 R35 S40
G90
G21
M83 ; use relative distances for extrusion
M981 S1 P20000 ;open spaghetti detector
; CHANGE_LAYER
; Z_HEIGHT: 0.2
; LAYER_HEIGHT: 0.2
G1 E-.8 F1800
; layer num/total_layer_count: 1/2
M622.1 S1
M991 S0 P0 ;notify layer change
; OBJECT_ID: 15
G17
G3 Z.6 I1.217 J0 P1  F42000
G1 X0 Y0 Z.6
G1 Z.2
G1 E.8 F1800
; FEATURE: Outer wall
; LINE_WIDTH: 0.42
G1 X20 Y0 E0.62709
G1 X20 Y20 E0.62709
G1 X0 Y20 E0.62709
G1 X0 Y0 E0.62709
; WIPE_START
G1 X2 Y0 E-.5
G1 X2 Y1 E-.3
; WIPE_END
G17
G2 Z.6 I0.86 J0.86 P1  F42000
G1 X1 Y1 Z.6
G1 Z.2
G1 E.8
; FEATURE: Inner wall
; LINE_WIDTH: 0.45
G1 X19 Y1 E0.60928
G1 X19 Y19 E0.60928
G1 X1 Y19 E0.60928
G1 X1 Y1 E0.60928
; CHANGE_LAYER
; Z_HEIGHT: 0.4
; LAYER_HEIGHT: 0.2
G1 E-.8 F1800
M73 L2
M991 S0 P1 ;notify layer change
G17
G3 Z.6 I1.217 J0 P1  F42000
G1 X0 Y0
G1 Z.4
G1 E.8 F1800
; FEATURE: Outer wall
; LINE_WIDTH: 0.42
G1 X20 Y0 E0.62709
G1 X20 Y20 E0.62709
G1 X0 Y20 E0.62709
G1 X0 Y0 E0.62709
; filament end gcode
M106 P3 S0
; MACHINE_END_GCODE_START
M400
G92 E0
G1 E-0.8 F1800
M620 S255
T255
G1 X0 Y50 F12000
M621 S255
M140 S0
M1003 S0
M73 P100 R0
; EXECUTABLE_BLOCK_END
