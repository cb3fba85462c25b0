//! Every closed form: its drawing, the order of its joints, γ, G and g.
//!
//! A closed form maps the independent coordinates y of one mechanism to all of its coordinates q =
//! γ(y), with q̇ = G ẏ and q̈ = G ÿ + g, see [notation](super::notation). A form is read off the
//! geometry at the zero pose: points, axes, and signs, never off names. So coordinates are zero
//! where the robot was written, a length is its value at zero plus the slider's coordinate, and a
//! coordinate may have the opposite sense of a drawing if its axis points the other way. J is a
//! turn by a right angle in the plane, W = x × y the number J x · y.
//!
//! A geometry that fits the form up to the rounding of a file is closed by it alone; up to 1e-3 of
//! the mechanism's size the form starts Newton's method on the true rows; beyond that, loading
//! fails and names the axis. Every form has two solutions or more; the one of the zero pose is kept
//! for all y, by the sign of its root.
//!
//! | type | joints, in the order of their lists | y | cut rows |
//! |---|---|---|---|
//! | RRPR | rocker, stator, slider | rocker | 2 |
//! | FOURBAR | crank, coupler, rocker | any one | 2 |
//! | SLIDERCRANK | crank, coupler, slider | any one | 2 |
//! | PARALLELOGRAMCHAIN | crank, coupler, follower of each loop, any order | 1 a loop | 2 a loop |
//! | 2SPU+1U | J₁ J₂ of the universal joint; turn, turn, slider of each leg: 8 | J₁ J₂ | 3 a leg |
//! | 2SPRR+1U | the same 8; or J₁ J₂, two arms, then the legs: 10 | J₁ J₂ | 3 or 4 a leg |
//! | 2SURRPR+1U | J₁ J₂; crank, stator, slider, universal joint of each rod: 12; any order | J₁ J₂ | 5 a leg |
//! | 6UPS | x y z rx ry rz of the platform; turn, turn, slider a leg: 24 | first 6 | 3 a leg |
//! | TRANSMISSION | any | those that follow none | by couplings |
//! | DIFFERENTIAL | cage, spider and wheels, 3 or 4 | two of them | by couplings |
//!
//! A cut of five rows, as of a hinge, serves as well as two in the plane; loading names redundant
//! rows, which Newton's method leaves out until the others come near a singular pose. RRPR,
//! SLIDERCRANK, 2SPU+1U, 2SPRR+1U and 6UPS define their cuts if none is given: the pin is the
//! origin of the slider's frame. 2SURRPR+1U falls back on Newton's method, with a warning, where
//! axes do not cross or Newton's method does not confirm the form beside the zero pose.
//!
//! # RRPR
//!
#![doc = include_str!("../../docs/rrpr.svg")]
//!
//! A lambda: the rocker turns about J₁, the stator about J₂, and the slider's pin is cut from the
//! rocker. In the plane perpendicular to the rocker's axis, with d₃ the pin and d₁ the stator's
//! pivot, both from J₁ at zero, ε the offset of the pin from the pivot across the slider:
//!
//! ```text
//!   d = R(y) d₃ − d₁ = R(θ) (ℓ t₀ + ε J t₀)
//!   ℓ = ±√(|d|² − ε²),    q₃ = ℓ − ℓ₀ = (|d|² − |d₀|²) / (ℓ + ℓ₀)
//!   q₂ = θ = atan2(w × d, w · d),    w = ℓ t₀ + ε J t₀
//!
//!   with p = J R(y) d₃, t = R(θ) t₀, b = J t
//!   G₂ = b · p / ℓ                       g₂ = b · x / ℓ
//!   G₃ = t · p + ε G₂                    g₃ = t · x + ε g₂
//!   x = q̇₂² d − ẏ² R(y) d₃ − 2 q̇₂ q̇₃ b
//! ```
//! Singular where ℓ = 0: the pin is as near to J₂ as the slider's offset allows.
//!
//! # FOURBAR
//!
#![doc = include_str!("../../docs/fourbar.svg")]
//!
//! Four turns J₀ to J₃ and four links a, b, c, d of any length; J₀ is the independent joint, one of
//! the others is cut. With p = R(y) a the place of J₁ and D = d − p from there to J₃:
//!
//! ```text
//!   b = κ D + η J D,   c = b − D,   κ = (|D|² + |b|² − |c|²) / (2 |D|²),   W = b × c = η |D|²
//!   W = ±√(|b|² |D|² − κ² |D|⁴)
//!   q₁ = ∠b − y,    q₂ = ∠c − ∠b,    q₃ = −∠c          angles since zero
//!
//!   with D′ = −J p
//!   b′ = D′ · c / W        c′ = D′ · b / W        rates of the links for ẏ = 1
//!   b″ = x · c / W         c″ = x · b / W,    x = p + b′² b − c′² c
//!   G₁ = b′ − 1,  G₂ = c′ − b′,  G₃ = −c′              g = (b″, c″ − b″, −c″) ẏ²
//! ```
//! q₃ has the other sign where, as drawn, its joint moves the rocker. Singular where W = 0: coupler
//! and rocker in one line.
//!
//! # SLIDERCRANK
//!
#![doc = include_str!("../../docs/slidercrank.svg")]
//!
//! A FOURBAR with J₃ a slider along t, c its bearing. With p the place of J₁, p = R(y) a where J₀
//! turns and a + y t where it slides:
//!
//! ```text
//!   b = L t + ε J t,    ε = ε₀ − J t · (p − a),    L = ±√(|b|² − ε²)
//!   q₃ = L − L₀ + t · (p − a),    q₁ = ∠b − y,    q₂ = −∠b
//!
//!   b′ = −p′ · J t / L     s′ = p′ · b / L                     for ẏ = 1
//!   b″ = x · J t / L       s″ = −x · b / L,    x = b′² b − p″
//!   G₁ = b′ − 1 (b′ where J₀ slides),  G₂ = −b′,  G₃ = s′      g = (b″, −b″, s″) ẏ²
//! ```
//! A slider opposite to the independent joint makes the loop an RRPR. Singular where L = 0: the
//! coupler stands across the slider.
//!
//! # PARALLELOGRAMCHAIN
//!
#![doc = include_str!("../../docs/parallelogramchain.svg")]
//!
//! Opposite sides are equal, so opposite links turn as one and every coupler keeps its direction:
//!
//! ```text
//!   q = M y + b,    M: 1 at crank and follower, −1 at the coupler,    G = M,    g = 0
//! ```
//! with signs by the senses of the axes; couplings (`<mimic>`) may stand for loops. Singular where
//! all bars lie in one line, which q does not show: the linear branch is kept through it.
//!
//! # 2SPU+1U
//!
#![doc = include_str!("../../docs/spu2u1.svg")]
//!
//! A platform on two turns, held by two legs, each of two turns whose axes X and Y cross at C at a
//! right angle and a slider whose end P is cut from the platform as a ball. In the leg's frame,
//! with v = P − C by the pose of the platform, a the slider's direction at zero and e ⟂ a its
//! offset from C:
//!
//! ```text
//!   v = R_x(q₁) R_y(q₂) w,    w = ℓ a + e,    ℓ = ±√(|v|² − |e|²),    q₃ = ℓ − ℓ₀
//!   z = ±√(v_y² + v_z² − w_y²)
//!   q₂ carries (w_x, w_z) onto (v_x, z),    q₁ carries (w_y, z) onto (v_y, v_z)
//!
//!   S q̇_leg = Ṗ,    S = [ X × v   a₂ × v   a₃ ],    a₂ = R_x Y,   a₃ = R_x R_y a
//!   column k of G for a leg: S⁻¹ (z_k × (P − p_k))
//! ```
//! with z_k and p_k axis and point of the k-th joint under the platform; g is S⁻¹ of the pin's
//! acceleration at ÿ = 0 less that of the leg at its own rates. Here q₁ q₂ q₃ are those of one leg.
//! Singular where a leg lies along its first axis or has no length.
//!
//! # 2SPRR+1U
//!
#![doc = include_str!("../../docs/sprr2u1.svg")]
//!
//! 2SPU+1U with an offset in each leg.
//!
//! Offset at the base: the two axes pass at a distance r along Z. Then
//!
//! ```text
//!   v = R_x(q₁) (r Z + R_y(q₂) w),    z = ±√(v_y² + v_z² − e_y²) − r
//!   ℓ² = v_x² + z² + e_y² − |e|²,     S = [ X × v   a₂ × (v − r R_x Z)   a₃ ]
//! ```
//! Arms on the platform: an arm turns about n through P, and C stays in a plane of the arm with
//! normal m ⟂ n. In the axes of the platform, with D = C − P, k m n right-handed and h = m · D at
//! zero:
//!
//! ```text
//!   m₀ · R_n(−θ) D = h,    k₀ · R_n(−θ) D = ±√(D_k² + D_m² − h²)
//!   θ̇ (k · D) = −m · v_platform(C)
//! ```
//! which gives the arm's tip, for which the leg reaches as in 2SPU+1U. Singular as there, and where
//! k · D = 0.
//!
//! # 2SURRPR+1U
//!
#![doc = include_str!("../../docs/surrpr2u1.svg")]
//!
//! A platform on two turns, held by two rods. Each rod ends at A on a crank a that turns about Z,
//! and at B on the platform; at one end it has a universal joint whose axes cross at a right angle,
//! at the other a ball, which is the cut. A lambda in the crank's plane drives the crank, or, where
//! the type is NUMERICAL or the robot is built in code, a motor of its own. With d from the center
//! of A's circle to B, along the crank's axes, ℓ the length of the rod:
//!
//! ```text
//!   |d − R_z(θ) a X| = ℓ,    κ = ½ (a² + |d|² − ℓ²),    W = ±√(a² (d_x² + d_y²) − κ²)
//!   R_z(θ) a X = (κ d + W Z × d) / (d_x² + d_y²)        in the plane of the circle
//! ```
//! one quadratic equation of tan θ/2 a leg, and θ = q₃. Then the universal joint, with x the rod
//! from there to its ball along that joint's axes and w the same at zero:
//!
//! ```text
//!   x = R_x(q₆) R_y(q₇) w,    z = ±√(w_x² + w_z² − x_x²)
//!   q₇ takes (w_x, w_z) onto (x_x, z),    q₆ takes (w_y, z) onto (x_y, x_z)
//! ```
//! and q₄ q₅ are those of an RRPR whose rocker is the crank. With r the rod from universal joint to
//! ball, b and c that joint's axes, v the velocity of the platform in the ball, t that of A and s
//! that of the ball on the crank for θ̇ = 1:
//!
//! ```text
//!   G₃ = r · v / r · t,    r · t = ∓W
//!   G₆ = −c · e / z,       G₇ = b · e / z
//!   e = v − G₃ s with the universal joint on the crank,  G₃ t − v with it on the platform
//!   G₄ = G₄′ G₃,  G₅ = G₅′ G₃                            G′ and g′ those of the RRPR
//! ```
//! with v = z_k × (B − p_k) for column k; g has the same form with the acceleration of the platform
//! less that of the leg at their own rates for v, and g₄ = G₄′ g₃ + g₄′. Singular where W = 0:
//! crank and rod in one plane with Z; where z = 0: the rod along the first axis of its universal
//! joint; and where the lambda is.
//!
//! # Forms that are found, not named
//!
#![doc = include_str!("../../docs/found.svg")]
//!
//! Loops of type NUMERICAL, or of a type whose geometry they lack, are searched for structure; the
//! joints that are cut do not matter. `sarrus check` prints the parts; `closed_forms: off` keeps
//! Newton's method on all rows.
//!
//! **Mechanisms of a type** with a slider or legs: SLIDERCRANK, RRPR, 2SURRPR+1U, 2SPU+1U,
//! 2SPRR+1U.
//!
//! **Pairs of links** in a plane: a link that an independent joint turns is known; then any two
//! links that a pin C joins, each with another pin, A or B, on a known link, are the coupler and
//! the rocker of a FOURBAR with D = B − A, one pair after the other. With X = x + R(θ) r a point of
//! a known link:
//!
//! ```text
//!   D′ = B′ − A′,    X′ = x′ + θ′ J r              for ẏ_k = 1 alone
//!   θ_b′ = D′ · c / W,    θ_c′ = D′ · b / W        rates of the two links
//!   D″ = B″ − A″,    X″ = x″ + θ″ J r − θ̇² r       at ÿ = 0
//!   θ_b″ = x · c / W,    θ_c″ = x · b / W,    x = D″ + θ̇_b² b − θ̇_c² c
//! ```
//! One joint of a pair may slide, or two may, and independent sliders are known links too. With g
//! the guide, r the arm of A's link and o an offset, the rates of the two ways and turns solve
//! c₁ σ̇₁ + c₂ σ̇₂ = D′:
//!
//! ```text
//!   B slides            r = D + x g,     x = −g · D ± √(r² − (g × D)²)     c = J r, −g
//!   C slides            D = R (o J g + x g),    x = ±√(|D|² − o²)          c = J D, g
//!   A and B, or C too   D = x₁ g₁ + x₂ g₂                                  c = g₁, g₂
//! ```
//! **Blocks one after the other**: the rows of a cluster are sorted into blocks, and each is closed
//! on those before it. Where every block has one of these forms, or is couplings alone, with joints
//! that others before it found for its independents, the forms give q, and G_d = −K_d⁻¹ K_i and g
//! of each block its rates: of the leg of a Kangaroo three pairs, two legs and four pairs.
//!
//! **Rods**, one for each dependent beside their own turns: the two turns of a universal joint
//! whose axes cross at a right angle, on a link with a ball at its other end, enter the loops only
//! through the length ℓ of that link. With d from the center P of the universal joint to that of
//! the ball, S, one row replaces the three of the ball:
//!
//! ```text
//!   φ = ½ (|d|² − ℓ²) / ℓ,    φ̇ = d · ḋ / ℓ,    φ̈ = (d · d̈ + ḋ · ḋ) / ℓ
//! ```
//! Two or three steps of Newton's method from the table solve these rows, by the rule of acceptance
//! of all; the inverse of the last, with one step of refinement, serves G and g. n and m follow
//! as those of a rod of 2SURRPR+1U. Singular where the rows are, and where z = 0, the rod along the
//! first axis of its universal joint; the declared rows are so too. A link of a plane or a
//! spherical linkage, on a hinge and with a pin, is such a rod: from a point P of the hinge's axis
//! to the pin, with n alone for its turns. A third turn of a rod about itself is idle.
//!
//! **Any other loop** of joints with one freedom takes two to four of Newton's steps on its own
//! rows from the table, q_d ← q_d − A⁻¹ φ; A⁻¹ of the first one, or of the second where seeds are
//! rough, serves those after it. Redundant rows hold at every node: Bennett's and Bricard's loops.
//!
//! These forms answer a request without a guess at a pose to which the straight path from the zero
//! pose is known to be regular: loading has compared them with Newton's method at every node of a
//! table of such poses. Beyond it the path is followed on the declared rows from where it leaves
//! the table. From a guess, and with another end of Newton's method, that answers on the declared
//! rows; K, k and λ are always those of these.
//!
//! # 6UPS
//!
#![doc = include_str!("../../docs/ups6.svg")]
//!
//! A Stewart platform: six legs as in 2SPU+1U, on a platform that three sliders and three turns
//! carry, or one floating joint. For a sliding joint under the platform the column of G is S⁻¹ z_k.
//!
//! # TRANSMISSION
//!
#![doc = include_str!("../../docs/transmission.svg")]
//!
//! Joints that follow others linearly, also one after the other, by `<mimic>` or `<transmission>`:
//!
//! ```text
//!   q_j = Σ c q_master + b    solved for    q = M y + b,    G = M,    g = 0
//! ```
//! A motor may sit on any of them: u̇ = G_u ẏ takes its row of M. Curves f over one joint each, by
//! polynomials or tables, add their values. Where each of them finds its joint among y and the
//! joints before it, the rows are solved for them too, with the share S of each in every joint:
//!
//! ```text
//!   q = M y + b + Σ S f(q_i)     G = M + Σ S f' G_i     g = Σ S (f' g_i + f'' q̇_i²)
//! ```
//! Otherwise, and within loops, each curve is an implicit row with K_i = −f' and k = f'' q̇_i².
//!
//! # DIFFERENTIAL
//!
#![doc = include_str!("../../docs/differential.svg")]
//!
//! Bevel gears: two couplings of two masters each.
//!
//! ```text
//!   q_left = y₁ + y₂,    q_right = y₁ − y₂
//! ```
//! Whether the file gives the wheels by cage and spider or the other way round does not matter: the
//! rows are solved for the dependent joints.
